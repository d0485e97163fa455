"""Generated files: the page's typed messages, and tables and diagrams of the documentation."""
