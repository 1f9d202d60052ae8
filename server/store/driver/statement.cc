#include "server/store/driver/statement.h"

namespace selfcal::server {

bool Statement::Next() {
  if (!status_.ok()) return false;
  const absl::StatusOr<bool> row = prepared_->Step();
  if (row.ok()) return *row;
  status_ = row.status();
  return false;
}

absl::Status Statement::Run() {
  while (Next()) {
  }
  return status_;
}

void Statement::Prepare(std::string_view sql, Reuse reuse) {
  auto prepared = reuse == Reuse::kKept ? connection_->Take(sql)
                                        : connection_->TakeOnce(sql);
  if (prepared.ok()) {
    prepared_ = *std::move(prepared);
  } else {
    status_ = prepared.status();
  }
}

void Statement::Bind(int index, std::int64_t value) {
  if (status_.ok()) status_ = prepared_->BindInt(index, value);
}

void Statement::Bind(int index, double value) {
  if (status_.ok()) status_ = prepared_->BindDouble(index, value);
}

void Statement::Bind(int index, std::string_view value) {
  if (status_.ok()) status_ = prepared_->BindText(index, value);
}

void Statement::Bind(int index, BlobView value) {
  if (status_.ok()) status_ = prepared_->BindBlob(index, value.bytes);
}

}  // namespace selfcal::server
