"""The tamper-evident record: rows, writer, checks and the session report."""
