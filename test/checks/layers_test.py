#!/usr/bin/env python3
"""Tests layers.py on small trees: what is declared passes, the rest fails."""

import pathlib
import unittest

from small_tree import SmallTreeTest

LAYERS = pathlib.Path(__file__).resolve().with_name("layers.py")

TREE = {
    "core/low/CMakeLists.txt": "selfcal_module(low SOURCES low.cc)",
    "core/low/low.h": "",
    "core/low/low.cc": '#include "core/low/low.h"\n',
    "core/mid/CMakeLists.txt": "selfcal_module(mid SOURCES mid.cc USES low)",
    "core/mid/mid.h": '#include "core/low/low.h"\n',
    "core/mid/mid.cc": '#include "core/mid/mid.h"\n',
    # The dependency is named by a variable, in one branch of a condition.
    "server/high/CMakeLists.txt": "if(WITH_MID)\n  set(more mid)\nendif()\n"
    "selfcal_module(high SOURCES high.cc  # a comment\n  USES ${more})",
    "server/high/high.cc": '#include "core/mid/mid.h"\n'
    '#include "core/low/low.h"\n#include "selfcal/v1/rig.pb.h"\n',
}


class LayersTest(SmallTreeTest):
    CHECK = LAYERS
    TREE = TREE

    def test_declared_includes_pass_directly_and_through_others(self):
        self.assertEqual(self.check({})[0], 0)

    def test_an_undeclared_include_is_named_with_its_line(self):
        self.expect_one(
            {"core/low/low.cc": '\n#include "core/mid/mid.h"\n'},
            "core/low/low.cc:2: ",
            "low does not declare that it uses mid",
            "core/low/CMakeLists.txt",
        )

    def test_an_include_in_angle_brackets_is_checked_as_well(self):
        self.expect_one(
            {"core/low/low.cc": "#include<core/mid/mid.h>\n"},
            "core/low/low.cc:1: ",
        )

    def test_the_include_of_a_header_is_checked_as_well(self):
        self.expect_one(
            {"core/low/low.h": '#include "core/mid/mid.h"\n'},
            "core/low/low.h:1: ",
        )

    def test_what_is_used_privately_is_not_passed_on(self):
        self.expect_one(
            {
                "core/mid/CMakeLists.txt": "selfcal_module(mid SOURCES mid.cc "
                "PRIVATE_USES low)",
                "server/high/high.cc": '#include "core/low/low.h"\n',
            },
            "server/high/high.cc:1: ",
        )

    def test_generated_messages_belong_to_their_target(self):
        self.expect_one(
            {
                "proto/CMakeLists.txt": "selfcal_messages_library(messages "
                "PROTOS selfcal/v1/rig.proto)"
            },
            "server/high/high.cc:3: ",
            "messages",
        )

    def test_generated_services_belong_to_their_target(self):
        self.expect_one(
            {
                "proto/CMakeLists.txt": "add_library(services STATIC "
                "selfcal/v1/rig.proto)\nprotobuf_generate(TARGET services "
                "LANGUAGE grpc)",
                "server/high/high.cc": '#include "selfcal/v1/rig.grpc.pb.h"\n',
            },
            "server/high/high.cc:1: ",
            "services",
        )

    def test_a_dependency_against_the_layers_is_named(self):
        self.expect_one(
            {
                "core/low/CMakeLists.txt": "selfcal_module(low SOURCES low.cc "
                "USES conversion)",
                "proto/CMakeLists.txt": "selfcal_module(conversion SOURCES "
                "a.cc)",
            },
            "core/low/CMakeLists.txt: low uses conversion",
            "core may only use core",
        )

    def test_a_cycle_is_named(self):
        self.expect_one(
            {
                "core/low/CMakeLists.txt": "selfcal_module(low SOURCES low.cc "
                "USES mid)"
            },
            "a cycle: mid -> low -> mid",
        )


if __name__ == "__main__":
    unittest.main()
