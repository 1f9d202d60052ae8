#include "test/server/store/sqlite/fault_vfs.h"

#include <chrono>
#include <filesystem>
#include <utility>

namespace selfcal::server {
namespace {

using Kind = DiskOperation::Kind;

// A file of the shim; the real one lies behind it in the same memory.
struct ShimFile {
  sqlite3_file base;
  FaultVfs* vfs;
  std::string* name;

  sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};

ShimFile* Shim(sqlite3_file* file) { return reinterpret_cast<ShimFile*>(file); }

sqlite3_file* Real(sqlite3_file* file) { return Shim(file)->real(); }

int Close(sqlite3_file* file) {
  const int code = Real(file)->pMethods->xClose(Real(file));
  delete Shim(file)->name;
  return code;
}

int Read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
  return Real(file)->pMethods->xRead(Real(file), to, size, offset);
}

double Now() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

int Write(sqlite3_file* file, const void* from, int size, sqlite3_int64 at) {
  const int code =
      Shim(file)->vfs->Before(*Shim(file)->name, Kind::kWrite, at, from, size);
  if (code != SQLITE_OK) return code;
  const double start = Now();
  const int done = Real(file)->pMethods->xWrite(Real(file), from, size, at);
  Shim(file)->vfs->Used(*Shim(file)->name, {size, 0, Now() - start, 0});
  return done;
}

int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  const int code = Shim(file)->vfs->Before(
      *Shim(file)->name, Kind::kTruncate, size, nullptr, 0);
  if (code != SQLITE_OK) return code;
  return Real(file)->pMethods->xTruncate(Real(file), size);
}

int Sync(sqlite3_file* file, int flags) {
  const int code =
      Shim(file)->vfs->Before(*Shim(file)->name, Kind::kSync, 0, nullptr, 0);
  if (code != SQLITE_OK) return code;
  const double start = Now();
  const int done = Real(file)->pMethods->xSync(Real(file), flags);
  Shim(file)->vfs->Used(*Shim(file)->name, {0, 1, 0, Now() - start});
  return done;
}

int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return Real(file)->pMethods->xFileSize(Real(file), size);
}
int Lock(sqlite3_file* file, int level) {
  return Real(file)->pMethods->xLock(Real(file), level);
}
int Unlock(sqlite3_file* file, int level) {
  return Real(file)->pMethods->xUnlock(Real(file), level);
}
int CheckReservedLock(sqlite3_file* file, int* out) {
  return Real(file)->pMethods->xCheckReservedLock(Real(file), out);
}
int FileControl(sqlite3_file* file, int what, void* argument) {
  return Real(file)->pMethods->xFileControl(Real(file), what, argument);
}
int SectorSize(sqlite3_file* file) {
  return Real(file)->pMethods->xSectorSize(Real(file));
}
// None: a write may be torn and come before an earlier one.
int DeviceCharacteristics(sqlite3_file*) { return 0; }
int ShmMap(
    sqlite3_file* file, int page, int size, int extend, void volatile** p) {
  return Real(file)->pMethods->xShmMap(Real(file), page, size, extend, p);
}
int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
  return Real(file)->pMethods->xShmLock(Real(file), offset, n, flags);
}
void ShmBarrier(sqlite3_file* file) {
  Real(file)->pMethods->xShmBarrier(Real(file));
}
int ShmUnmap(sqlite3_file* file, int remove) {
  return Real(file)->pMethods->xShmUnmap(Real(file), remove);
}

constexpr sqlite3_io_methods kMethods = {2,
                                         Close,
                                         Read,
                                         Write,
                                         Truncate,
                                         Sync,
                                         FileSize,
                                         Lock,
                                         Unlock,
                                         CheckReservedLock,
                                         FileControl,
                                         SectorSize,
                                         DeviceCharacteristics,
                                         ShmMap,
                                         ShmLock,
                                         ShmBarrier,
                                         ShmUnmap,
                                         nullptr,
                                         nullptr};

std::string BaseName(const char* path) {
  return path ? std::filesystem::path(path).filename().string() : std::string();
}

int Open(sqlite3_vfs* vfs,
         const char* path,
         sqlite3_file* file,
         int flags,
         int* flags_out) {
  auto* self = static_cast<FaultVfs*>(vfs->pAppData);
  ShimFile* shim = Shim(file);
  shim->base.pMethods = nullptr;
  const int code =
      self->real()->xOpen(self->real(), path, shim->real(), flags, flags_out);
  if (code != SQLITE_OK) return code;
  shim->vfs = self;
  shim->name = new std::string(BaseName(path));
  shim->base.pMethods = &kMethods;
  return SQLITE_OK;
}

int Delete(sqlite3_vfs* vfs, const char* path, int sync_folder) {
  auto* self = static_cast<FaultVfs*>(vfs->pAppData);
  const int code = self->real()->xDelete(self->real(), path, sync_folder);
  if (code == SQLITE_OK) self->Deleted(BaseName(path));
  return code;
}

}  // namespace

FaultVfs::FaultVfs() : real_(sqlite3_vfs_find(nullptr)) {
  shim_ = *real_;
  shim_.pNext = nullptr;
  shim_.zName = "selfcal-fault";
  shim_.pAppData = this;
  shim_.szOsFile = static_cast<int>(sizeof(ShimFile)) + real_->szOsFile;
  shim_.xOpen = Open;
  shim_.xDelete = Delete;
  // The rest of the default's functions work on names alone.
  shim_.xFullPathname =
      [](sqlite3_vfs* vfs, const char* path, int n, char* to) {
        sqlite3_vfs* real = static_cast<FaultVfs*>(vfs->pAppData)->real();
        return real->xFullPathname(real, path, n, to);
      };
  sqlite3_vfs_register(&shim_, 1);
}

FaultVfs::~FaultVfs() {
  sqlite3_vfs_unregister(&shim_);
  sqlite3_vfs_register(real_, 1);
}

void FaultVfs::SetFault(Fault fault) {
  const std::lock_guard lock(mutex_);
  fault_ = std::move(fault);
  operations_ = 0;
}

void FaultVfs::SetMaxFileBytes(std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  max_file_bytes_ = bytes;
}

int FaultVfs::operations() const {
  const std::lock_guard lock(mutex_);
  return operations_;
}

DiskUse& DiskUse::operator+=(const DiskUse& other) {
  bytes += other.bytes;
  syncs += other.syncs;
  write_s += other.write_s;
  sync_s += other.sync_s;
  return *this;
}

DiskUse FaultVfs::use(const std::string& suffix) const {
  const std::lock_guard lock(mutex_);
  DiskUse sum;
  for (const auto& [file, use] : use_) {
    if (file.ends_with(suffix)) sum += use;
  }
  return sum;
}

void FaultVfs::Used(const std::string& file, const DiskUse& use) {
  const std::lock_guard lock(mutex_);
  use_[file] += use;
}

void FaultVfs::StartRecording() {
  const std::lock_guard lock(mutex_);
  recording_ = true;
  recorded_.clear();
}

void FaultVfs::Mark(int mark) {
  const std::lock_guard lock(mutex_);
  recorded_.push_back({Kind::kMark, "", 0, "", mark});
}

std::vector<DiskOperation> FaultVfs::TakeRecording() {
  const std::lock_guard lock(mutex_);
  recording_ = false;
  return std::move(recorded_);
}

int FaultVfs::Before(const std::string& file,
                     Kind kind,
                     std::int64_t offset,
                     const void* bytes,
                     std::int64_t size) {
  const std::lock_guard lock(mutex_);
  ++operations_;
  if (kind == Kind::kWrite && max_file_bytes_ > 0 &&
      offset + size > max_file_bytes_) {
    return SQLITE_FULL;
  }
  if (fault_) {
    const int code = fault_(operations_, kind);
    if (code != SQLITE_OK) return code;
  }
  if (recording_) {
    recorded_.push_back(
        {kind,
         file,
         offset,
         std::string(static_cast<const char*>(bytes ? bytes : ""),
                     static_cast<std::size_t>(size)),
         0});
  }
  return SQLITE_OK;
}

void FaultVfs::Deleted(const std::string& file) {
  const std::lock_guard lock(mutex_);
  if (recording_) recorded_.push_back({Kind::kDelete, file, 0, "", 0});
}

}  // namespace selfcal::server
