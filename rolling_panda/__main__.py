"""`python -m rolling_panda`: the same as the `rolling-panda` command."""

import sys

from rolling_panda.cli.main import main

sys.exit(main())
