#include "server/grpc/answer_queue.h"

#include <algorithm>

namespace selfcal::server {

void AnswerQueue::Answer::Fill(const absl::Status& result,
                               grpc::ByteBuffer* bytes) {
  status = result;
  response.Swap(bytes);
  filled = true;
  work.Shrink(0);
}

AnswerQueue::Answer* AnswerQueue::Add() {
  return answers_.emplace_back(std::make_unique<Answer>()).get();
}

bool AnswerQueue::AllFilled() const {
  return std::all_of(answers_.begin(), answers_.end(), [](const auto& answer) {
    return answer->filled;
  });
}

const grpc::ByteBuffer* AnswerQueue::BeginWrite() {
  if (writing_ || answers_.empty() || !answers_.front()->filled) return nullptr;
  const Answer& first = *answers_.front();
  if (!first.status.ok()) {
    error_ = first.status;
    return nullptr;
  }
  writing_ = true;
  return &first.response;
}

void AnswerQueue::EndWrite() {
  writing_ = false;
  answers_.pop_front();
}

}  // namespace selfcal::server
