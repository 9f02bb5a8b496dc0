"""`python -m proofs`."""

import sys

from proofs.run import main

sys.exit(main())
