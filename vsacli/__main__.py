"""`python -m vsacli` is the command `vsacli`."""

import signal


def main() -> None:
    """Entry point of the command `vsacli`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C before anything has begun: end without a word
    from vsacli.cli import main as command

    command()


if __name__ == "__main__":
    main()
