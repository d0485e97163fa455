"""FastAPI in front of Viser: sessions, REST, the page's socket and the 3-D scene."""
