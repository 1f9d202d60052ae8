"""Sphinx's settings; docs/site/build runs it, and sets the folders."""

import os
import re
import sys

from docutils import nodes

sys.path.insert(0, os.environ["SELFCAL_SITE_PYTHON"])

project = "selfcal"
author = "the selfcal authors"
copyright = author  # noqa: A001: Sphinx's name
extensions = ["myst_parser", "breathe", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = "selfcal"
html_copy_source = False
html_show_sphinx = False
templates_path: list = []

nitpicky = True
myst_heading_anchors = 4

breathe_projects = {"selfcal": os.environ["SELFCAL_SITE_DOXYGEN"]}
breathe_default_project = "selfcal"
breathe_default_members = ("members",)
cpp_index_common_prefix = ["selfcal::", "selfcal::client::"]
# Of the extra `mcap`, not in Debian.
autodoc_mock_imports = ["foxglove_schemas_protobuf", "mcap_protobuf"]
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": True}
autodoc_typehints = "signature"

# What is documented elsewhere.
nitpick_ignore_regex = [
    (r"cpp:.*", r"(std|Eigen|absl|selfcal)(::.*)?"),
    (r"cpp:identifier", r"chrono|u?int\d+_t|milliseconds|v1"),
    # Within a declaration Breathe gives them without their scope.
    (r"cpp:identifier", r"(k?[A-Z]\w*)(::\w+)*"),
    (r"py:.*", r"(grpc|numpy|np|typing|google|pathlib)\..*"),
    (r"py:.*", r"collections\..*|ndarray"),
]


def _contract_reference(app, env, node, contnode):
    """Messages of the Python package are those of the contract's pages."""
    match = re.search(r"(?:_pb2|v1|\b\w+)\.(\w+)$", node.get("reftarget", ""))
    if node.get("refdomain") != "py" or not match:
        return None
    label = f"selfcal.v1.{match[1]}".lower()
    labels = env.get_domain("std").anonlabels
    if label not in labels:
        return None
    page, anchor = labels[label]
    uri = app.builder.get_relative_uri(node["refdoc"], page)
    return nodes.reference(
        "", "", contnode, internal=True, refuri=f"{uri}#{anchor}"
    )


def setup(app):
    app.connect("missing-reference", _contract_reference)
