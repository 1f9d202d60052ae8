#include "proto/nearest_word.h"

#include <gtest/gtest.h>

namespace selfcal {
namespace {

const std::vector<std::string> kVerbs = {"list", "show", "delete", "activate"};

TEST(NearestWord, FindsMisspellings) {
  EXPECT_EQ(NearestWord("lst", kVerbs), "list");
  EXPECT_EQ(NearestWord("shoq", kVerbs), "show");
  EXPECT_EQ(NearestWord("Deletq", kVerbs), "delete");
  EXPECT_EQ(NearestWord("acitvat", kVerbs), "activate");
}

TEST(NearestWord, FindsTheRestOfABeginning) {
  EXPECT_EQ(NearestWord("act", kVerbs), "activate");
  EXPECT_EQ(NearestWord("ac", kVerbs), "") << "too short to be meant";
}

TEST(NearestWord, FindsNothingFarAway) {
  EXPECT_EQ(NearestWord("", kVerbs), "");
  EXPECT_EQ(NearestWord("bananas", kVerbs), "");
  EXPECT_EQ(NearestWord("x", {"y"}), "") << "nothing in common";
  EXPECT_EQ(NearestWord(std::string(1000, 'l'), kVerbs), "");
  EXPECT_EQ(NearestWord("list", {}), "");
}

TEST(NearestWord, AsksWhatWasMeant) {
  EXPECT_EQ(DidYouMean("lst", kVerbs), "; did you mean 'list'?");
  EXPECT_EQ(DidYouMean("bananas", kVerbs), "");
}

}  // namespace
}  // namespace selfcal
