"""rtamt, which reads formulas, and what of it is used here.

It needs antlr 4.7, which imports ``typing.io``: deprecated since Python 3.8 and gone with 3.12. The name is there while
antlr is loaded. What antlr prints of its versions (rtamt's parser was made by another one) is kept from stdout.

Legend:
    told: Where the parser is.
"""

from __future__ import annotations

import contextlib
import io
import sys
import typing

_known = sys.modules.get("typing.io")
sys.modules["typing.io"] = typing
try:
    import antlr4
    import rtamt
    from rtamt.antlr.parser.stl.error.parser_error_listener import STLParserErrorListener
    from rtamt.antlr.parser.stl.StlLexer import StlLexer
    from rtamt.semantics.enumerations.comp_oper import StlComparisonOperator as Comparison
    from rtamt.syntax.ast.visitor.stl.ast_visitor import StlAstVisitor
finally:
    if _known is None:
        del sys.modules["typing.io"]
    else:
        sys.modules["typing.io"] = _known

__all__ = ["Comparison", "Patient", "StlAstVisitor", "identifiers", "read", "rtamt"]


class Patient(STLParserErrorListener):  # type: ignore[misc]  # rtamt has no types
    """Raises mistakes alone: rtamt's own raises where antlr has to look twice, too, as it has at ``2*x - 1 > 0``."""

    def reportAmbiguity(self, *told: object) -> None:  # noqa: N802
        """Two readings, of which the first is taken."""

    def reportAttemptingFullContext(self, *told: object) -> None:  # noqa: N802
        """A second look."""

    def reportContextSensitivity(self, *told: object) -> None:  # noqa: N802
        """A second look that found one reading."""


def identifiers(formula: str) -> list[str]:
    """Names in a formula, sorted.

    Args:
        formula: The formula; where it is none the names are still found.
    """
    with contextlib.redirect_stdout(io.StringIO()):
        lexer = StlLexer(antlr4.InputStream(formula))
        lexer.removeErrorListeners()
        return sorted({token.text for token in lexer.getAllTokens() if token.type == StlLexer.Identifier})


def read(formula: str, names: list[str]) -> typing.Any:
    """The tree of a formula.

    Args:
        formula: The formula.
        names: Names that stand for signals.

    Raises:
        ValueError: It cannot be read.
    """
    specification = rtamt.StlDiscreteTimeOfflineSpecification()
    for name in names:
        specification.declare_var(name, "float")
    specification.spec = formula
    specification.ast.parserErrorListenerType = Patient
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            specification.parse()
        (tree,) = specification.ast.specs
    except (rtamt.RTAMTException, KeyError, ValueError, AttributeError, TypeError, RecursionError) as error:
        raise ValueError(str(error).removeprefix("RTAMT Exception: ").strip() or type(error).__name__) from error
    return tree
