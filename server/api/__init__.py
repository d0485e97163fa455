"""REST routes, request bodies, the page's socket and the guard around them."""
