"""What is known over time: tracked points, closer looks and canes that stay."""
