"""Mutations beside mutmut's own: whole checks, handlers and calls are taken away, and words for people are let be."""

import builtins
from collections.abc import Iterable

import libcst as cst
from mutmut.mutation import mutators

_NEVER = cst.Name("False")
_ALWAYS = cst.Name("True")
#: Arguments that say how something is called or written down, which decides nothing.
_LABELS = frozenset({"metavar", "help", "prog", "description", "dest", "encoding", "daemon"})


def extend() -> None:
    """Bring mutmut's list of mutations to this one."""
    own = {mutators.operator_string: _strings, mutators.operator_arg_removal: _arguments}
    mutators.mutation_operators[:] = [
        *((kind, own.get(operator, operator)) for kind, operator in mutators.mutation_operators),
        (cst.If, _conditions),
        (cst.ExceptHandler, _handlers),
        (cst.Expr, _statements),
        (cst.Call, _wrappers),
    ]


def _words(node: cst.CSTNode) -> bool:
    """Whether this is a text for people. What it says is no check, and no test compares sentences."""
    match node:
        case cst.FormattedString():
            return True
        case cst.ConcatenatedString():
            return _words(node.left) or _words(node.right)
        case cst.SimpleString():
            return " " in node.value
    return False


def _label(argument: cst.Arg) -> bool:
    return argument.keyword is not None and argument.keyword.value in _LABELS


def _strings(node: cst.BaseString) -> Iterable[cst.CSTNode]:
    if not _words(node):
        # Three spellings of the same name would say the same thing three times.
        yield from list(mutators.operator_string(node))[:1]


def _arguments(node: cst.Call) -> Iterable[cst.CSTNode]:
    if not any(_words(argument.value) or _label(argument) for argument in node.args):
        yield from mutators.operator_arg_removal(node)


def _conditions(node: cst.If) -> Iterable[cst.CSTNode]:
    """What a condition guards is never done, and where mutmut leaves the condition alone, always."""
    if not isinstance(node.test, cst.Name) or node.test.value not in ("True", "False"):
        yield node.with_changes(test=_NEVER, whitespace_before_test=cst.SimpleWhitespace(" "))
    if isinstance(node.test, cst.Name | cst.Attribute | cst.Call):
        yield node.with_changes(test=_ALWAYS, whitespace_before_test=cst.SimpleWhitespace(" "))


def _handlers(node: cst.ExceptHandler) -> Iterable[cst.CSTNode]:
    """Each kind of error in turn is not handled any more."""
    nothing = cst.Tuple([])
    match node.type:
        case None:
            return
        case cst.Tuple(elements=elements) if len(elements) > 1:
            for i in range(len(elements)):
                kept = [*elements[:i], *elements[i + 1 :]]
                yield node.with_changes(type=cst.Tuple([cst.Element(each.value) for each in kept]))
        case _:
            yield node.with_changes(type=nothing, whitespace_after_except=cst.SimpleWhitespace(" "))


def _statements(node: cst.Expr) -> Iterable[cst.CSTNode]:
    """What is called for what it does is not called."""
    called = node.value.expression if isinstance(node.value, cst.Await) else node.value
    if isinstance(called, cst.Call):
        yield cst.Expr(cst.Ellipsis())


def _wrappers(node: cst.Call) -> Iterable[cst.CSTNode]:
    """`checked(value)` becomes `value`."""
    match node:
        case cst.Call(func=cst.Name(value=name), args=[cst.Arg(keyword=None, star="", value=value)]):
            if not hasattr(builtins, name) and name.lstrip("_")[:1].islower() and not _words(value):
                yield value.with_changes(lpar=[*value.lpar, cst.LeftParen()], rpar=[cst.RightParen(), *value.rpar])
