"""Where the camera is on the hand: from pictures of a board, and a monitor from ordinary work."""
