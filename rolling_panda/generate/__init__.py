"""What is made from the message definitions: the page's typed messages and the tables of the wire's documentation."""
