"""Extension of Sphinx: what pages of the site have that their Markdown has not.

Markdown that the repository shows as it is says nothing of navigation. The pages below a page are
in the configuration, the commands are told by the program, and a link to a notebook in a list comes
with the notebook's last picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from docs.site.commands import describe_commands

COMMANDS = "docs/reference/commands"
GALLERY = "docs/gallery/"


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the extension to a build."""
    app.add_config_value("navigation", {}, "env", dict)
    app.add_config_value("short_titles", {}, "env", dict)
    app.connect("source-read", complete_source)
    app.connect("doctree-resolved", show_pictures)
    app.add_lexer("output", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def complete_source(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the navigation, and what the program tells of its commands, behind a page's Markdown."""
    if docname == COMMANDS:
        source[0] += f"\n{describe_commands()}"
    if below := app.config.navigation.get(docname):
        source[0] += f"\n{navigation(below, app.config.short_titles)}"


def navigation(pages: list[str], titles: Mapping[str, str]) -> str:
    """Return the directive for pages below a page; only patterns are listed on the page itself."""
    entries = [f"{titles[page]} </{page}>" if page in titles else f"/{page}" for page in pages]
    by_pattern = any("*" in page for page in pages)
    options = [":glob:", ":maxdepth: 1"] if by_pattern else [":hidden:"]
    return "\n".join(["```{toctree}", *options, "", *entries, "```", ""])


def show_pictures(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Show the last picture of a notebook in list items that begin with a link to it."""
    notebooks = {
        app.builder.get_relative_uri(docname, page): page
        for page in app.config.navigation.get(f"{GALLERY}index", ())
    }
    for items in doctree.findall(nodes.bullet_list):
        for item in items.children:
            link = next(item.findall(nodes.reference), None)
            page = notebooks.get(link.get("refuri")) if link else None
            picture = last_picture(app, page) if page else None
            if picture is not None:
                picture["alt"] = link.astext()
                items["classes"] = ["gallery"]
                item.insert(0, picture)


def last_picture(app: Sphinx, page: str) -> nodes.image | None:
    """Return a copy of the last picture on a page."""
    pictures: Iterator[nodes.image] = app.env.get_doctree(page).findall(nodes.image)
    last = next(reversed(list(pictures)), None)
    if last is None:
        return None
    return nodes.image(uri=last["uri"], candidates=last["candidates"])
