"""One lap behind a leader: neither into it nor far behind."""
