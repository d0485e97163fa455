"""State over time: tracked points, close-up checks, retained canes."""
