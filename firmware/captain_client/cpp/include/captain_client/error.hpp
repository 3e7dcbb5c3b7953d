// Errors of the client: each has a message and a hint, the remedy.
#ifndef CAPTAIN_CLIENT_ERROR_HPP
#define CAPTAIN_CLIENT_ERROR_HPP

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace captain_client {

/// Base of all errors of the client. what() is the message and the hint.
class Error : public std::runtime_error {
public:
    explicit Error(std::string message, std::string hint = "")
        : std::runtime_error(hint.empty() ? message : message + "; " + hint), message_(std::move(message)), hint_(std::move(hint))
    {
    }
    const std::string &message() const noexcept { return message_; }
    const std::string &hint() const noexcept { return hint_; }

private:
    std::string message_, hint_;
};

/// The station does not answer, or takes no message.
class UnreachableError : public Error {
public:
    using Error::Error;
};

/// The outcome of a request is unknown: a timeout, a signal, or a restart of the station.
class UnconfirmedError : public Error {
public:
    using Error::Error;
};

/// Fault of a message: a path such as cam.camParameters.basicContainer.stationType, its problem and the invalid value.
struct Fault {
    std::string path, problem;
    nlohmann::json value; ///< null if it is missing
};

/// The station has refused the request, or no interface has sent it.
class RefusedError : public Error {
public:
    RefusedError(const std::string &message, const std::string &hint, std::string reason, std::string detail, std::vector<Fault> invalid)
        : Error(message, hint), reason_(std::move(reason)), detail_(std::move(detail)), invalid_(std::move(invalid))
    {
    }
    const std::string &reason() const noexcept { return reason_; } ///< such as "bad-json": firmware/reference/drops.md
    const std::string &detail() const noexcept { return detail_; } ///< cause in this case; may be empty
    const std::vector<Fault> &invalid() const noexcept { return invalid_; } ///< all faults of a message in JSON

private:
    std::string reason_, detail_;
    std::vector<Fault> invalid_;
};

} // namespace captain_client

#endif
