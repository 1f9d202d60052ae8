#!/usr/bin/env python3
"""Tests architecture.py: this tree's document passes, changed ones fail."""

import pathlib
import unittest

from small_tree import SmallTreeTest

ROOT = pathlib.Path(__file__).resolve().parents[2]
CHECK = ROOT / "test/checks/architecture.py"
DOCUMENT = "docs/architecture.md"

# The graph is in lines 4 to 9.
GRAPH = """# Architecture

```
client/tool   -> server/high (only messages,
                 no calls), core/mid
client/script -> the installed package
server/high   -> core/mid, server/low
server/low    -> nothing of selfcal; all of server may include it
core/mid, core/top -> core/low
```

"""
MODULES = (
    "client/tool", "client/script", "server/high", "server/low", "core/top",
    "core/mid", "core/low",
)  # fmt: skip
TABLE = "".join(f"| `{module}` | content |\n" for module in MODULES)

TREE = {
    DOCUMENT: GRAPH + TABLE,
    "core/low/CMakeLists.txt": "selfcal_module(low SOURCES low.cc USES Eigen)",
    "core/mid/CMakeLists.txt": "selfcal_module(mid SOURCES mid.cc USES low)",
    "core/top/CMakeLists.txt": "selfcal_module(top SOURCES t.cc USES low)",
    "server/low/CMakeLists.txt": "selfcal_module(status)",
    # `low` is passed on by `mid`; `status` is open to all of server.
    "server/high/CMakeLists.txt": "selfcal_module(high SOURCES high.cc "
    "USES mid low PRIVATE_USES status)",
    "client/tool/CMakeLists.txt": "selfcal_module(tool SOURCES tool.cc "
    "USES high PRIVATE_USES mid)",
    "client/script/script.py": "",
}


class ArchitectureTest(SmallTreeTest):
    CHECK = CHECK
    TREE = TREE

    def expect_one_in_document(self, old: str, new: str, *words: str) -> None:
        document = TREE[DOCUMENT]
        self.assertEqual(document.count(old), 1)
        self.expect_one({DOCUMENT: document.replace(old, new)}, *words)

    def test_the_document_of_this_tree_is_right(self):
        code, lines = self.run_check(ROOT)
        self.assertEqual(code, 0, "\n".join(lines))
        self.assertGreater(int(lines[0].split()[0]), 40)

    def test_a_document_that_agrees_passes(self):
        self.assertEqual(self.check({}), (0, ["6 modules"]))

    def test_a_dependency_that_the_graph_lacks_is_named_with_its_module(self):
        self.expect_one_in_document(
            "server/high (only messages,\n                 no calls), ",
            "",
            f"{DOCUMENT}:4: client/tool uses high of server/high",
            "add server/high to the line of client/tool",
        )

    def test_a_module_that_the_graph_lacks_is_named(self):
        self.expect_one_in_document(
            "core/mid, core/top",
            "core/mid",
            f"{DOCUMENT}:1: core/top uses low of core/low",
        )

    def test_what_is_used_privately_is_not_passed_on(self):
        self.expect_one(
            {
                "core/mid/CMakeLists.txt": "selfcal_module(mid SOURCES mid.cc "
                "PRIVATE_USES low)"
            },
            f"{DOCUMENT}:7: server/high uses low of core/low",
        )

    def test_only_the_folder_that_may_include_a_module_may_omit_it(self):
        self.expect_one(
            {
                "core/top/CMakeLists.txt": "selfcal_module(top SOURCES top.cc "
                "USES low status)"
            },
            f"{DOCUMENT}:9: core/top uses status of server/low",
        )

    def test_a_dependency_that_is_not_declared_is_named_with_its_line(self):
        self.expect_one_in_document(
            "no calls), core/mid",
            "no calls), core/mid,\n  core/top",
            f"{DOCUMENT}:6: client/tool may not include core/top",
            "client/tool/CMakeLists.txt",
        )

    def test_a_dependency_that_is_passed_on_may_be_listed(self):
        document = TREE[DOCUMENT].replace(
            "core/mid, server/low", "core/mid, core/low, server/low"
        )
        self.assertEqual(self.check({DOCUMENT: document})[0], 0)

    def test_a_module_that_does_not_exist_is_named_with_its_line(self):
        self.expect_one_in_document(
            "core/mid, server/low",
            "core/mid, server/log, server/low",
            f"{DOCUMENT}:7: there is no module server/log",
        )

    def test_a_module_without_a_row_in_the_table_is_named(self):
        self.expect_one_in_document(
            "| `core/top` | content |\n", "", "no row for core/top"
        )

    def test_a_row_of_a_module_that_does_not_exist_is_named(self):
        self.expect_one_in_document(
            "| `core/top` | content |\n",
            "| `core/top` | content |\n| `core/old` | content |\n",
            f"{DOCUMENT}:17: there is no module core/old",
        )


if __name__ == "__main__":
    unittest.main()
