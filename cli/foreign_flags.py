"""Builds the message about an unknown flag that other programs have, see `baker.core.foreign_names`."""

from __future__ import annotations

from typing import Any

from baker.core.foreign_names import foreign_answer


def answer(option: str, known: set[str], command: str) -> str | None:
    """Return a sentence that recommends a flag or a section of LIMITS.md instead of an unknown flag.

    Parameters
    ----------
    option : str
        The unknown flag, as typed.
    known : set of str
        Flags of the command. A flag that the command does not have is not recommended.
    command : str
        The command as typed, such as "baker bake".

    Returns
    -------
    str or None
        None if `foreign_answer` knows neither a flag of the command nor a section.
    """
    found = foreign_answer(option.lstrip("-"), {flag.removeprefix("--") for flag in known})
    if found is None:
        return None
    verb, what = found
    if verb == "use":
        return f"{command} has no {option}: use --{what}; `{command} --help-all` describes it"
    return f"{command} has no {option}: see {what}"


def answer_error(error: Any) -> str | None:
    """Return the sentence of `answer` if the error is about an unknown flag; None otherwise."""
    option, context = getattr(error, "option_name", None), getattr(error, "ctx", None)
    if type(error).__name__ != "NoSuchOption" or option is None or context is None:
        return None
    known = {name for param in context.command.params for name in (*param.opts, *param.secondary_opts)}
    return answer(option, known, context.command_path)
