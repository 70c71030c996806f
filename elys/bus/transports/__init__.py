"""What carries bytes: zenoh between processes, loopback inside one (both as `transport.Transport` says), MCAP files on disk."""
