"""The web node: one page that shows a session in a browser, and lets it be steered."""
