// Client of a captain station in C++17: sends ITS messages, reads their confirms and receives messages.
//
//   captain_client::Station box;                                     // this machine; Station(":5565"), Station("captain-7.local")
//   box.send("cam", {{"speed", 13.9}, {"latitude", 48.76}, {"longitude", 11.43}}).confirmed();
//   for (const auto &message : box.listen({"cam", "denm"}))
//       std::cout << message.type << ' ' << message.get("speedValue") << '\n';
//
// Guide: firmware/guide/client-cpp.md. It starts no thread; one thread at a time may use a Station and what it returns.
#ifndef CAPTAIN_CLIENT_HPP
#define CAPTAIN_CLIENT_HPP

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "captain_client/address.hpp"
#include "captain_client/connection.hpp"
#include "captain_client/error.hpp"
#include "captain_client/message.hpp"
#include "captain_client/reports.hpp"
#include "captain_client/requests.hpp"

namespace captain_client {

/// A sent message, which the station confirms.
class Sent {
public:
    Sent(std::shared_ptr<Connection> connection, std::shared_ptr<Request> request)
        : connection_(std::move(connection)), request_(std::move(request))
    {
    }

    /// Return the `label` of its confirms.
    const std::string &label() const { return request_->label; }

    /// Wait for all confirms of the message, and return the interfaces that have sent it and those that have not.
    /// Throws RefusedError if the station has refused it or no interface has sent it, and UnconfirmedError after the timeout,
    /// after a restart of the station, or when a signal handler has run.
    Confirmed confirmed(Milliseconds timeout = default_timeout)
    {
        if (!connection_->wait([this] { return request_->state != Request::State::open; }, timeout))
            throw UnconfirmedError(request_->type + ": not confirmed within " + std::to_string(timeout.count()) + " ms",
                                   "the message may have been sent; `captain status` shows whether the station is busy");
        return request_->result();
    }

private:
    static constexpr std::chrono::seconds default_timeout{15}; // JSON may wait 10 s for the station's encoder

    std::shared_ptr<Connection> connection_;
    std::shared_ptr<Request> request_;
};

/// A station, reached by its ports for messages to send and for reports.
class Station {
public:
    /// Connect, and wait until the station answers.
    ///   address  HOST, HOST:PORT, :PORT or [V6]:PORT; PORT is the first of the station's ports.
    ///   timeout  of the connection, and of status() and send().
    /// Throws std::invalid_argument for an invalid address, UnreachableError if the station does not answer.
    explicit Station(const std::string &address = "", Milliseconds timeout = std::chrono::seconds(3))
        : connection_(std::make_shared<Connection>(Address::parse(address), timeout))
    {
    }

    /// Send a message of these fields: short names or paths, in SI units and degrees. The station fills in all others.
    ///   type     such as "cam", or an edition such as "cam-1.4.1".
    ///   options  of firmware/guide/endpoint.md, such as {{"lifetime_s", 2.0}}.
    /// Throws UnreachableError if the station does not take it.
    Sent send(const std::string &type, const nlohmann::json &fields = nlohmann::json::object(), const nlohmann::json &options = {})
    {
        return send_json(type, "fields", fields, "plain", options);
    }
    /// Send a whole message in JSON; the station fills in header, time and position. Throws UnreachableError.
    Sent send_message(const std::string &type, const nlohmann::json &message, Form form = Form::plain, const nlohmann::json &options = {})
    {
        return send_json(type, "message", message, form == Form::json ? "json" : "plain", options);
    }
    /// Send the octets of a message; with an empty type, the station reads it from the octets. Throws UnreachableError.
    Sent send_pdu(const std::string &type, const Octets &pdu, const nlohmann::json &options = {})
    {
        return {connection_, connection_->send(type, pdu.data(), pdu.size(), checked(options))};
    }

    /// Receive messages of these types, or of all types. The first user of Form::plain or Form::json starts the station's
    /// decoder, which misses the messages of half a second. Throws std::invalid_argument for a type that the station does not know.
    Listener listen(const std::vector<std::string> &types = {}, Form form = Form::plain) { return {connection_, types, form}; }

    /// Receive other reports: topics such as "indication.", "confirm.cam.", "time." or "frame.g5.".
    Reports reports(const std::vector<std::string> &topics) { return {connection_, topics}; }

    /// Return the next status of the station. Throws UnreachableError.
    nlohmann::json status() { return connection_->next_status(); }

    /// Return the number of messages that the listeners of this object have missed.
    std::uint64_t missed() const { return connection_->missed; }

private:
    Sent send_json(const std::string &edition, const char *member, const nlohmann::json &value, const char *form, const nlohmann::json &options)
    {
        nlohmann::json all = checked(options);
        all["form"] = form;
        const std::string body = nlohmann::json{{"edition", edition}, {member, value}}.dump();
        return {connection_, connection_->send(edition.substr(0, edition.find('-')), body.data(), body.size(), std::move(all))};
    }

    /// Return the options as an object. Throws Error for `label` and `form`, which the client sets.
    static nlohmann::json checked(const nlohmann::json &options)
    {
        for (const char *name : {"label", "form"})
            if (options.contains(name))
                throw Error(std::string("options: ") + name + ": set by the client", "leave it out");
        return options.is_null() ? nlohmann::json::object() : options;
    }

    std::shared_ptr<Connection> connection_;
};

} // namespace captain_client

#endif
