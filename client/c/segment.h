// The segment that passes from a builder to a stream.
#pragma once

#include "client/c/selfcal.h"
#include "client/selfcal/closed_segment.h"

struct selfcal_segment {
  selfcal::client::ClosedSegment closed;
};
