"""One robot of the server: its link, its state for the page, presence and teleoperation."""
