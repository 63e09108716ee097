"""Formulas of the site: LaTeX between dollars in the pages becomes MathML: no script, no font."""

import html
import re

_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(content, **_):
    """The HTML of a page with its formulas as MathML; mkdocs calls it."""
    return _FORMULA.sub(lambda match: mathml(html.unescape(match[2]), match[1] == "div"), content)


def mathml(latex, is_block):
    """MathML of a formula. Raises what latex2mathml raises for LaTeX that it does not know."""
    from latex2mathml.converter import convert

    formula = convert(latex.strip(), display="block" if is_block else "inline")
    return f'<div class="formula">{formula}</div>' if is_block else formula
