"""What the verbs of the command line do: here, and in `elys.launch`, nodes are put together."""
