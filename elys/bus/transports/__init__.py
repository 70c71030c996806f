"""What carries bytes: zenoh between processes, loopback inside one, MCAP on disk. All have the face of `transport.Transport`."""
