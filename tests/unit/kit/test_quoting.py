"""Claims: a text of others stays a text in HTML, a shell and TOML, and nothing invisible is shown.

The oracles are the readers of these languages: `html.parser`, ``sh``, `tomllib`.
"""

import keyword
import subprocess
import tomllib
import unicodedata
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.kit import UserError, quoting

_MARKS = st.sampled_from("<>&;'\"\\`$#=.-[]{} \n\r\x00\x1b\x7f\u202e")  # rare among all characters
texts = st.text(_MARKS | st.characters(exclude_categories=["Cs"]), max_size=30)


class _Read(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, attrs))

    def handle_data(self, data):
        self.found.append(data)


def read(page):
    parser = _Read()
    parser.feed(page)
    parser.close()
    return parser.found


@given(texts.filter(str.isprintable).filter(str.strip))
def test_a_text_is_one_text_and_one_attribute_in_html(text):
    quoted = quoting.html(text)
    assert read(f'<i title="{quoted}">{quoted}</i>') == [("i", [("title", text)]), text]


@given(st.text(max_size=30))
def test_what_is_shown_is_printable_and_the_same_if_it_was(text):
    shown = quoting.visible(text)
    assert shown.isprintable()
    assert shown == text or not text.isprintable()
    hidden = [c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]
    assert not set(hidden) & {*shown, *quoting.html(text)} - {"\n"}
    assert "\n" not in quoting.line(text)


def test_an_escape_says_which_character_it_is():
    assert quoting.visible("a\x1b[2J\u202eb\udc80", keep="\n") == r"a\x1b[2J\u202eb\udc80"
    assert quoting.line("two\n lines\x00") == r"two lines\x00"


@given(st.text(max_size=30))
def test_an_identifier_is_one_in_python_and_in_c(text):
    name = quoting.identifier(text, "model")
    assert name.isascii()
    assert name.isidentifier()
    assert not name.startswith("_")
    assert not any(map(keyword.iskeyword, (name, name.capitalize())))


def test_an_identifier_resembles_its_text():
    names = ["two layers", "2-layer", "class", "none", "§", ""]
    found = [quoting.identifier(name, "model") for name in names]
    assert found == ["two_layers", "model_2_layer", "model_class", "model_none", "model", "model"]


def test_letters_of_other_languages_stay_readable():
    names = [
        "Kühlung",
        "Ku\u0308hlung",
        "Öffnung",
        "Maß",
        "débit",
        "Δp",
        "ϑ_1",
        "m²",
        "Å",
        "µ",
        "ciepło",
    ]
    found = [quoting.identifier(name, "model") for name in names]
    expected = "Kuehlung Kuehlung Oeffnung Mass debit Deltap theta_1 m2 A mu cieplo"
    assert found == expected.split()


@given(texts)
def test_toml_reads_a_key_and_a_text_back(text):
    written = f"{quoting.toml_key(text)} = {quoting.toml(text)}\n# {quoting.visible(text)}\n"
    assert tomllib.loads(written) == {text: text}


def test_a_plain_key_is_bare_and_bytes_that_are_no_text_are_refused():
    assert quoting.toml_key("R_1-a") == "R_1-a"
    with pytest.raises(UserError, match=r"a\\udc80: bytes that are no text"):
        quoting.toml("a\udc80")


def test_a_shell_gets_the_words_and_a_file_is_no_option():
    words = ["$(touch CANARY)", "a'b", "`id`", "; ls", "two\nlines", "", "*", "--option"]
    command = quoting.shell(["printf", "%s\\0", *words, Path("-rf"), Path("a b")])
    told = subprocess.run(["sh", "-c", command], capture_output=True, check=True, text=True)
    assert told.stdout.split("\0")[:-1] == [*words, "./-rf", "a b"]


@given(st.lists(st.text(max_size=9), max_size=4))
def test_words_of_a_command_are_those_that_were_written(given_words):
    assert quoting.words(quoting.shell(given_words)) == given_words


def test_a_quotation_that_is_not_closed_is_refused():
    with pytest.raises(UserError, match=r"^a 'b: No closing quotation$"):
        quoting.words("a 'b")


def test_signals_of_python_control_have_no_full_stop():
    assert quoting.control(["bench.x", "y"]) == ["bench/x", "y"]
