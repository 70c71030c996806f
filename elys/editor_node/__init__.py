"""The editor: a window onto a session that somebody else hosts.

Every edit is a command to the host; what the panels show is what the host echoed.
"""
