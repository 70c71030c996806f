"""The editor's panels: each draws one window of widgets from the model, and calls the model's operations."""
