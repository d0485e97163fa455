"""Other people's whole-body solvers on the same problems, each a script that runs in an environment of its own."""
