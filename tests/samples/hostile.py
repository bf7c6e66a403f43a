"""Texts that are nearly files: what hypothesis makes of a good one."""

from __future__ import annotations

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

YAML = (
    st.sampled_from("{}[]'#~\n\t\0\u2028\ufeff")
    | st.sampled_from(["&a ", "*a", "<<: ", "- ", "? ", ": ", "!!int ", "---\n", "%Y\n", "|\n"])
    | st.sampled_from(["on", "1e999", "1e308", "-1", "90 deg", "1/0", ""])
)
CSV = st.sampled_from(
    [
        ",",
        ";",
        "\t",
        "\n",
        "\r",
        "#",
        '"',
        "\0",
        "\ufeff",
        "e",
        "nan",
        "inf",
        "1e308",
        "-1e-308",
        "1e99",
        "0",
        "q1",
    ]
)
XML = st.sampled_from(
    ["<", ">", "/>", "</", '"', "'", "&", "&lt;", "&#0;", "<!--", "-->", "<![CDATA[", "]]>", "\0"]
) | st.sampled_from(
    ['<!DOCTYPE a [<!ENTITY b "c">]>', "&b;", "<?xml?>", "<link>", "<joint/>", "1e308", "nan"]
)


@st.composite
def damaged(draw, text, fragments):
    """The text with a few pieces of it replaced by fragments of syntax or by noise."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        length = draw(st.integers(0, 12))
        text = text[:start] + draw(fragments | st.text(max_size=8)) + text[start + length :]
    return text


def fuzz(examples):
    """Settings for so many examples."""
    return settings(
        max_examples=examples, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
