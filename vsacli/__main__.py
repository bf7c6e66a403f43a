"""`python -m vsacli` is the command `vsacli`."""

from vsacli.cli import main

main()
