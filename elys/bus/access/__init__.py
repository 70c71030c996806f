"""Who may come into a session, and what each may do there. See docs/security.md."""
