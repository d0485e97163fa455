"""What is made from the message and mode definitions: the page's typed messages, tables and diagrams of the docs."""
