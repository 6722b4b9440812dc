"""Claims: keys are Z85 as ZeroMQ reads it; a file without them is refused and not quoted."""

from __future__ import annotations

import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from zmq.utils import z85

from fmus.kit.errors import UserError
from fmus.rig_proxy.credentials import checked, read_client_keys

GOOD = "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7"  # from the specification of ZMQ CURVE's examples
BAD = {
    "missing": ('public_key = "{k}"', "server_key is missing"),
    "no TOML": ("public_key = ", "not TOML"),
    "no text": ("\xff", "not TOML"),
    "a number": ('server_key = 5\npublic_key = "{k}"\nsecret_key = "{k}"', "must be a text"),
    "short": ('server_key = "abc"\npublic_key = "{k}"\nsecret_key = "{k}"', "3 characters"),
    "quoted": ("server_key = '{t}\"'\npublic_key = '{k}'\nsecret_key = '{k}'", "not Z85"),
    "too large": (
        "server_key = '{h}#####'\npublic_key = '{k}'\nsecret_key = '{k}'",
        "no four bytes",
    ),
    "of a server": ("public_key = '{k}'\nsecret_key = '{k}'\nclients = []", "key file of a server"),
}


@pytest.mark.parametrize("what", BAD)
def test_a_file_that_is_none_is_refused_in_a_line(tmp_path, what):
    text, why = BAD[what]
    path = tmp_path / "client.toml"
    path.write_bytes(text.format(k=GOOD, t=GOOD[:-1], h=GOOD[:-5]).encode("latin-1"))
    with pytest.raises(UserError, match=why) as caught:
        read_client_keys(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert GOOD[:20] not in str(caught.value)


def test_a_missing_file_a_folder_and_a_long_one(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(UserError, match=str(path)):
            read_client_keys(path)
    (tmp_path / "long.toml").write_text("#" * 100_000)
    with pytest.raises(UserError, match="no key file"):
        read_client_keys(tmp_path / "long.toml")


@given(st.binary(min_size=32, max_size=32))
def test_whatever_is_z85_is_a_key(key):
    text = z85.encode(key).decode()
    assert checked(text, "here") == text


@given(st.text(max_size=50) | st.text(alphabet="ab0#&\"'", min_size=40, max_size=40))
@settings(suppress_health_check=[HealthCheck.too_slow])
def test_what_is_not_is_refused(text):
    try:
        is_key = len(text) == 40 and len(z85.decode(text.encode())) == 32
    except (ValueError, KeyError, struct.error):
        is_key = False
    if is_key:
        assert checked(text, "here") == text
    else:
        with pytest.raises(UserError):
            checked(text, "here")
