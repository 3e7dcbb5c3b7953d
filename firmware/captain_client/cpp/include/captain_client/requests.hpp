// Requests that wait for their confirms: matched by label, without I/O.
//
//   open       the confirms `accepted`, then `sent` or `dropped` of each interface of `accepted`, are still to come
//   confirmed  all have come
//   refused    the station has refused it
//   lost       the station was restarted: no confirm will come
#ifndef CAPTAIN_CLIENT_REQUESTS_HPP
#define CAPTAIN_CLIENT_REQUESTS_HPP

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "captain_client/message.hpp"

namespace captain_client {

/// An interface that has dropped a request, with the reason.
struct Dropped {
    std::string interface, reason, meaning, detail;
};

/// Outcome of a request.
struct Confirmed {
    std::vector<std::string> sent; ///< interfaces that have sent it
    std::vector<Dropped> dropped;  ///< interfaces that have not
};

using Time = std::chrono::steady_clock::time_point;

/// A request and the confirms that came for it.
struct Request {
    enum class State { open, confirmed, refused, lost };

    std::string label, type;
    Time sent{}; ///< when the client sent it
    State state = State::open;
    bool is_accepted = false;
    std::size_t expected = 0; ///< number of interfaces of `accepted`
    Confirmed outcome;
    Dropped refusal;
    std::vector<Fault> invalid;

    /// Take over one confirm of this request.
    void confirm(const nlohmann::json &confirm);
    /// Return the outcome of a request that is not open. Throws RefusedError and UnconfirmedError.
    const Confirmed &result() const;
};

/// Open requests of one client. The client's labels differ from those of others by a random part.
class Requests {
public:
    Requests()
    {
        char part[9];
        std::snprintf(part, sizeof part, "%08x", std::random_device{}());
        prefix_ = "cpp-" + std::string(part) + "-";
    }

    /// Return a new open request, which is sent now.
    std::shared_ptr<Request> open(const std::string &type, Time now)
    {
        if (++number_ % sweep == 0)
            forget_ended();
        auto request = std::make_shared<Request>();
        request->label = prefix_ + std::to_string(number_);
        request->type = type;
        request->sent = now;
        open_.emplace(request->label, request);
        return request;
    }

    /// Take over a confirm; those of other users are ignored.
    void confirm(const nlohmann::json &confirm)
    {
        const auto found = open_.find(text(confirm, "label"));
        if (found == open_.end())
            return;
        const auto request = found->second.lock();
        if (request)
            request->confirm(confirm);
        if (!request || request->state != Request::State::open)
            open_.erase(found);
    }

    /// Return the run of the station, from its last status.
    const std::string &run() const { return run_; }

    /// Take over a status, received now. A new run of the station ends the requests that were sent before its start.
    void status(const nlohmann::json &status, Time now)
    {
        const std::string former = std::exchange(run_, text(status, "run"));
        if (former.empty() || former == run_)
            return;
        const auto uptime = status.find("uptime_s");
        const std::chrono::duration<double> age(uptime != status.end() && uptime->is_number() ? uptime->get<double>() : 0.0);
        for (auto &[label, weak] : open_)
            if (const auto request = weak.lock(); request && now - request->sent > age)
                request->state = Request::State::lost;
        forget_ended();
    }

private:
    static constexpr unsigned long sweep = 1024; // requests that nobody waits for are forgotten after so many others

    void forget_ended()
    {
        for (auto at = open_.begin(); at != open_.end();) {
            const auto request = at->second.lock();
            at = !request || request->state != Request::State::open ? open_.erase(at) : std::next(at);
        }
    }

    std::string prefix_, run_;
    unsigned long number_ = 0;
    std::unordered_map<std::string, std::weak_ptr<Request>> open_;
};

inline void Request::confirm(const nlohmann::json &confirm)
{
    const std::string came = text(confirm, "outcome");
    Dropped dropped{text(confirm, "interface"), text(confirm, "reason"), text(confirm, "meaning"), text(confirm, "detail")};
    if (came == "accepted") {
        is_accepted = true;
        expected = confirm.contains("interfaces") ? confirm["interfaces"].size() : 0;
    } else if (came == "refused") {
        state = State::refused;
        refusal = std::move(dropped);
        for (const auto &fault : confirm.value("invalid", nlohmann::json::array()))
            if (fault.is_object())
                invalid.push_back({text(fault, "path"), text(fault, "problem"), fault.value("value", nlohmann::json())});
    } else if (came == "sent") {
        outcome.sent.push_back(std::move(dropped.interface));
    } else if (came == "dropped") {
        outcome.dropped.push_back(std::move(dropped));
    }
    if (is_accepted && outcome.sent.size() + outcome.dropped.size() >= expected)
        state = State::confirmed;
}

inline const Confirmed &Request::result() const
{
    if (state == State::lost)
        throw UnconfirmedError(type + ": the station was restarted before it confirmed the message", "send it again");
    const bool is_dropped = outcome.sent.empty() && !outcome.dropped.empty();
    if (state != State::refused && !is_dropped)
        return outcome;
    const Dropped &cause = is_dropped ? outcome.dropped.front() : refusal;
    std::string message = type + (is_dropped ? ": dropped by " + cause.interface : ": refused") + ": " + cause.reason;
    constexpr std::size_t most = 3; // faults in the text; invalid() has all
    for (std::size_t i = 0; i < std::min(invalid.size(), most); ++i)
        message += "; " + invalid[i].path + ": " + invalid[i].problem;
    if (invalid.size() > most)
        message += "; and " + std::to_string(invalid.size() - most) + " more";
    if (invalid.empty() && !cause.detail.empty())
        message += ": " + cause.detail;
    throw RefusedError(message, cause.meaning, cause.reason, cause.detail, invalid);
}

} // namespace captain_client

#endif
