"""`python -m vsacli` is the command `vsacli`."""

import gc
import signal

COLLECTED_AT = 100_000
"""New objects after which Python looks for cycles among them. A short run makes fewer, nearly all of them by
imports and to stay, so that the usual searches after 700 take 3 % of its time and find nothing."""


def main() -> None:
    """Entry point of the command `vsacli`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C before anything has begun: end without a word
    gc.set_threshold(COLLECTED_AT)
    from vsacli.cli import main as command

    command()


if __name__ == "__main__":
    main()
