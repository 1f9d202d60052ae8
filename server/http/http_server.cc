#include "server/http/http_server.h"

#include <microhttpd.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <condition_variable>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <exception>
#include <list>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "server/access/tls_files.h"
#include "server/http/address.h"
#include "server/http/certificate.h"
#include "server/http/error_response.h"
#include "server/http/policy.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr unsigned kMaxConnections = 64;
constexpr std::size_t kMaxStreams = 16;
constexpr std::size_t kMaxBodyBytes = 64 << 10;
constexpr std::size_t kConnectionBytes = 32 << 10;  // limit of the headers
constexpr unsigned kIdleSeconds = 15;
constexpr std::size_t kMaxLogBytes = 500;
constexpr std::size_t kStreamBlock = 16 << 10;
// Interval of heartbeats, which keep proxies from closing an idle stream.
constexpr std::chrono::milliseconds kHeartbeat{5000};
// Interval of checks whether a client has disconnected, to make room for
// others.
constexpr std::chrono::milliseconds kLookForReader{100};
// How long a stop waits for requests in progress.
constexpr std::chrono::seconds kDrain{5};

// A request in progress; libmicrohttpd keeps the pointer to it.
struct Exchange {
  HttpRequest request;
  bool too_large = false;
};

// The stream that is sent after the body of a response.
struct Sending {
  std::string waiting;
  std::shared_ptr<HttpStream> stream;
  MHD_socket reader = MHD_INVALID_SOCKET;
  std::chrono::milliseconds silent{0};
};

void Log(void*, const char* format, va_list arguments) {
  std::array<char, kMaxLogBytes> line{};
  std::vsnprintf(line.data(), line.size(), format, arguments);
  spdlog::debug("HTTP: {}", line.data());
}

MHD_Result AddQuery(void* to,
                    MHD_ValueKind,
                    const char* key,
                    const char* text) {
  auto* query = static_cast<std::map<std::string, std::string>*>(to);
  (*query)[key] = text == nullptr ? "" : text;
  return MHD_YES;
}

MHD_Result AddHeader(void* to,
                     MHD_ValueKind,
                     const char* key,
                     const char* text) {
  std::string name = key;
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  auto* headers = static_cast<std::map<std::string, std::string>*>(to);
  (*headers)[name] = text == nullptr ? "" : text;
  return MHD_YES;
}

MHD_socket SocketOf(MHD_Connection* connection) {
  const MHD_ConnectionInfo* info =
      MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  return info == nullptr ? MHD_INVALID_SOCKET : info->connect_fd;
}

// True if the client has disconnected. Writing would not show it: the first
// write after a disconnection succeeds.
bool HasGone(MHD_socket reader) {
  pollfd state{reader, POLLRDHUP, 0};
  return poll(&state, 1, 0) > 0;
}

// Waits until there is something to send, which may be a heartbeat; false at
// the end.
bool AwaitMore(Sending* sending) {
  while (sending->waiting.empty()) {
    auto more = sending->stream->Take(kLookForReader);
    if (!more || HasGone(sending->reader)) return false;
    sending->waiting = *std::move(more);
    sending->silent += kLookForReader;
    if (sending->waiting.empty() && sending->silent >= kHeartbeat) {
      sending->waiting = ":\n\n";
    }
  }
  sending->silent = {};
  return true;
}

ssize_t ReadStream(void* from, std::uint64_t, char* to, std::size_t size) {
  auto* sending = static_cast<Sending*>(from);
  if (!AwaitMore(sending)) return MHD_CONTENT_READER_END_OF_STREAM;
  const std::size_t count = std::min(size, sending->waiting.size());
  std::memcpy(to, sending->waiting.data(), count);
  sending->waiting.erase(0, count);
  return static_cast<ssize_t>(count);
}

void EndStream(void* sending) { delete static_cast<Sending*>(sending); }

MHD_Result Send(MHD_Connection* connection, HttpResponse answer) {
  MHD_Response* response = nullptr;
  if (answer.stream == nullptr) {
    response = MHD_create_response_from_buffer(
        answer.body.size(), answer.body.data(), MHD_RESPMEM_MUST_COPY);
  } else {
    auto sending = std::make_unique<Sending>();
    sending->waiting = std::move(answer.body);
    sending->stream = std::move(answer.stream);
    sending->reader = SocketOf(connection);
    response = MHD_create_response_from_callback(
        MHD_SIZE_UNKNOWN, kStreamBlock, ReadStream, sending.get(), EndStream);
    if (response != nullptr) static_cast<void>(sending.release());
  }
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, "Content-Type", answer.type.c_str());
  for (const auto& [name, value] : SecurityHeaders()) {
    MHD_add_response_header(response, name, value);
  }
  for (const auto& [name, value] : answer.headers) {
    MHD_add_response_header(response, name.c_str(), value.c_str());
  }
  const MHD_Result queued = MHD_queue_response(
      connection, static_cast<unsigned>(answer.status), response);
  MHD_destroy_response(response);
  return queued;
}

// They are read once, at the start.
absl::StatusOr<TlsFiles> ReadFiles(const TlsOptions& options) {
  auto files = ReadTlsFiles(options, std::time(nullptr));
  if (files.ok() || !absl::IsInvalidArgument(files.status())) return files;
  return absl::InvalidArgumentError(
      "an address that is not loopback needs tls-certificate, tls-key and "
      "tls-client-ca; or use a loopback address such as 127.0.0.1:7448");
}

// The same status with the name of the setting that it is about.
absl::Status Named(const std::string& setting, const absl::Status& status) {
  if (status.ok()) return status;
  return {status.code(), setting + ": " + std::string(status.message())};
}

class MicroServer final : public HttpServer {
 public:
  MicroServer(const HttpOptions& options,
              const SocketAddress& address,
              HttpHandler handler)
      : name_(options.name),
        handler_(std::move(handler)),
        local_role_(options.local_role),
        loopback_(address.loopback) {}

  ~MicroServer() override {
    if (daemon_ == nullptr) return;
    const MHD_socket listening = MHD_quiesce_daemon(daemon_);
    EndConnections();
    MHD_stop_daemon(daemon_);
    if (listening != MHD_INVALID_SOCKET) close(listening);
  }

  absl::Status Start(const SocketAddress& address, const TlsOptions& tls) {
    TlsFiles files;
    unsigned flags = MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL |
                     MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_ITC |
                     MHD_USE_ERROR_LOG;
    if (address.ipv6) flags |= MHD_USE_IPv6;
    std::vector<MHD_OptionItem> more;
    if (!address.loopback) {
      SELFCAL_ASSIGN_OR_RETURN(files, ReadFiles(tls));
      flags |= MHD_USE_TLS;
      more = {{MHD_OPTION_HTTPS_MEM_CERT, 0, files.certificate.data()},
              {MHD_OPTION_HTTPS_MEM_KEY, 0, files.key.data()},
              {MHD_OPTION_HTTPS_MEM_TRUST, 0, files.client_ca.data()}};
    }
    more.push_back({MHD_OPTION_END, 0, nullptr});
    daemon_ = MHD_start_daemon(flags,
                               0,
                               &MicroServer::Accept,
                               this,
                               &MicroServer::Access,
                               this,
                               MHD_OPTION_EXTERNAL_LOGGER,
                               &Log,
                               nullptr,
                               MHD_OPTION_SOCK_ADDR,
                               address.get(),
                               MHD_OPTION_CONNECTION_LIMIT,
                               kMaxConnections,
                               MHD_OPTION_CONNECTION_MEMORY_LIMIT,
                               kConnectionBytes,
                               MHD_OPTION_CONNECTION_TIMEOUT,
                               kIdleSeconds,
                               MHD_OPTION_STRICT_FOR_CLIENT,
                               1,
                               MHD_OPTION_NOTIFY_COMPLETED,
                               &MicroServer::Completed,
                               nullptr,
                               MHD_OPTION_NOTIFY_CONNECTION,
                               &MicroServer::Connected,
                               this,
                               MHD_OPTION_ARRAY,
                               more.data(),
                               MHD_OPTION_END);
    if (daemon_ == nullptr) {
      return absl::UnavailableError(
          address.loopback
              ? "cannot open the port; check that it is free"
              : "cannot open the port; check that it is free, and that the TLS "
                "files are a certificate with its key");
    }
    const MHD_DaemonInfo* info =
        MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_BIND_PORT);
    url_ = (address.loopback ? "http://" : "https://") + address.host + ":" +
           std::to_string(info == nullptr ? 0 : info->port);
    return absl::OkStatus();
  }

  const std::string& url() const override { return url_; }

 private:
  static MHD_Result Accept(void* self, const sockaddr*, socklen_t) {
    return static_cast<MicroServer*>(self)->Announce() ? MHD_YES : MHD_NO;
  }

  static void Connected(void* self,
                        MHD_Connection* connection,
                        void**,
                        MHD_ConnectionNotificationCode code) {
    static_cast<MicroServer*>(self)->Count(
        SocketOf(connection), code == MHD_CONNECTION_NOTIFY_STARTED);
  }

  static MHD_Result Access(void* self,
                           MHD_Connection* connection,
                           const char* path,
                           const char* method,
                           const char*,
                           const char* data,
                           std::size_t* size,
                           void** state) {
    try {
      if (*state == nullptr) {
        auto exchange = std::make_unique<Exchange>();
        exchange->request.method = method;
        exchange->request.path = path;
        *state = exchange.release();
        return MHD_YES;
      }
      auto* exchange = static_cast<Exchange*>(*state);
      if (*size > 0) {
        std::string& body = exchange->request.body;
        exchange->too_large |= body.size() + *size > kMaxBodyBytes;
        if (!exchange->too_large) body.append(data, *size);
        *size = 0;
        return MHD_YES;
      }
      return Send(
          connection,
          static_cast<MicroServer*>(self)->Answer(connection, exchange));
    } catch (const std::exception& error) {
      spdlog::error("HTTP: {}", error.what());
      return MHD_NO;  // ends this connection
    }
  }

  static void Completed(void*,
                        MHD_Connection*,
                        void** state,
                        MHD_RequestTerminationCode) {
    delete static_cast<Exchange*>(*state);
    *state = nullptr;
  }

  HttpResponse Answer(MHD_Connection* connection, Exchange* exchange) {
    HttpRequest& request = exchange->request;
    if (exchange->too_large) {
      return ErrorResponse(absl::OutOfRangeError("the request exceeds 64 KiB"));
    }
    MHD_get_connection_values(
        connection, MHD_GET_ARGUMENT_KIND, &AddQuery, &request.query);
    MHD_get_connection_values(
        connection, MHD_HEADER_KIND, &AddHeader, &request.headers);
    const absl::Status allowed = CheckHost(request, loopback_);
    if (!allowed.ok()) return ErrorResponse(allowed);
    if (loopback_) {
      request.caller = {name_ + " on the loopback", {{local_role_, ""}}};
    } else {
      auto caller = Peer(connection);
      if (!caller.ok()) return ErrorResponse(caller.status());
      request.caller = *std::move(caller);
    }
    HttpResponse answer = handler_(request);
    return answer.stream == nullptr || Admit(answer.stream)
               ? std::move(answer)
               : ErrorResponse(absl::UnavailableError(
                     "too many pages are open, or the daemon is stopping; "
                     "close some pages and reload this one"));
  }

  static absl::StatusOr<Caller> Peer(MHD_Connection* connection) {
    const MHD_ConnectionInfo* info =
        MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
    if (info == nullptr) {
      return absl::UnauthenticatedError("this connection has no TLS");
    }
    return CallerOf(static_cast<gnutls_session_t>(info->tls_session));
  }

  // True if one more connection is allowed; Count() then registers it.
  bool Announce() {
    const std::lock_guard lock(mutex_);
    announced_ = !stopping_;
    return announced_;
  }

  void Count(MHD_socket connection, bool started) {
    const std::lock_guard lock(mutex_);
    if (started) {
      announced_ = false;
      connections_.insert(connection);
    } else {
      connections_.erase(connection);
      disconnected_.notify_all();
    }
  }

  // Once libmicrohttpd 0.9.75 has been told to stop, it accepts no response,
  // not even its own to a malformed request, which then makes it dereference a
  // null pointer. Therefore it is only stopped when no connection is left.
  void EndConnections() {
    std::unique_lock lock(mutex_);
    stopping_ = true;
    for (const auto& weak : streams_) {
      if (const auto stream = weak.lock()) stream->Close();
    }
    const auto deadline = std::chrono::steady_clock::now() + kDrain;
    while ((announced_ || !connections_.empty()) &&
           std::chrono::steady_clock::now() < deadline) {
      for (const MHD_socket socket : connections_) shutdown(socket, SHUT_RDWR);
      disconnected_.wait_for(lock, std::chrono::milliseconds(20));
    }
  }

  // True if one more stream is allowed.
  bool Admit(const std::shared_ptr<HttpStream>& stream) {
    const std::lock_guard lock(mutex_);
    streams_.remove_if([](const auto& weak) { return weak.expired(); });
    if (stopping_ || streams_.size() >= kMaxStreams) return false;
    streams_.push_back(stream);
    return true;
  }

  const std::string name_;
  const HttpHandler handler_;
  const Role local_role_;
  const bool loopback_;
  std::string url_;
  std::mutex mutex_;  // guards the five below
  std::list<std::weak_ptr<HttpStream>> streams_;
  std::set<MHD_socket> connections_;
  std::condition_variable disconnected_;
  bool announced_ = false;  // a connection is about to be counted
  bool stopping_ = false;
  MHD_Daemon* daemon_ = nullptr;
};

}  // namespace

absl::Status CheckHttpOptions(const HttpOptions& options) {
  const auto address = ParseSocketAddress(options.address);
  if (!address.ok()) return Named(options.name, address.status());
  return address->loopback
             ? absl::OkStatus()
             : Named(options.name, ReadFiles(options.tls).status());
}

absl::StatusOr<std::unique_ptr<HttpServer>> MakeHttpServer(
    const HttpOptions& options, HttpHandler handler) {
  SELFCAL_RETURN_IF_ERROR(CheckHttpOptions(options));
  SELFCAL_ASSIGN_OR_RETURN(const SocketAddress address,
                           ParseSocketAddress(options.address));
  auto server =
      std::make_unique<MicroServer>(options, address, std::move(handler));
  SELFCAL_RETURN_IF_ERROR(
      Named(options.name, server->Start(address, options.tls)));
  return server;
}

}  // namespace selfcal::server
