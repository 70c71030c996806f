"""What is said on the bus: msgspec Structs, and the packed state frame."""
