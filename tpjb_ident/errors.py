"""What the package raises when it must refuse: one base, known to the command line."""


class TpjbError(ValueError):
    """Base of every refusal of this package: what was given cannot be used; the message says why and what to do."""


class ArgumentError(TpjbError):
    """An argument of a function cannot be used: wrong shape, wrong range, an unknown name."""


class BadInputError(TpjbError):
    """Something the user gave cannot be used; the message says file, place, what is wrong, what to do."""


class NotTrustedError(Exception):
    """The command ran and wrote its results, but the answer is not to be trusted; the message says why."""
