// Received message: from the frames of a report to values with types.
#ifndef CAPTAIN_CLIENT_MESSAGE_HPP
#define CAPTAIN_CLIENT_MESSAGE_HPP

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include "captain_client/error.hpp"

namespace captain_client {

using Octets = std::vector<std::uint8_t>;

/// Report of the station: its topic, its object, and the third frame of `message.` and `frame.`.
struct Report {
    std::string topic;
    nlohmann::json object;
    Octets octets;
};

/// Form of received and sent messages.
enum class Form {
    plain, ///< JSON in SI units and degrees, special values by name
    json,  ///< JSON with the integers of the standard
    pdu,   ///< octets, which the station does not decode
};

/// Return a member of an object; nothing if it is absent, null, or of another type.
template <class T> std::optional<T> member(const nlohmann::json &object, const char *key)
{
    const auto found = object.find(key);
    if (found == object.end())
        return std::nullopt;
    const bool fits = std::is_same_v<T, std::string> ? found->is_string() : found->is_number_integer();
    return fits ? std::optional<T>(found->template get<T>()) : std::nullopt;
}

inline std::string text(const nlohmann::json &object, const char *key) { return member<std::string>(object, key).value_or(""); }

/// Message that the station has received.
struct Message {
    std::string type;                     ///< such as "cam"; empty for a message without a known type
    std::optional<std::uint32_t> station; ///< stationID; nothing if the PDU is shorter than its header
    std::string edition;                  ///< such as "cam-1.4.1"; empty with Form::pdu
    nlohmann::json value;                 ///< the decoded message; null with Form::pdu, and with an error
    std::string error;                    ///< cause why it does not decode; empty if it does
    Octets pdu;                           ///< with Form::pdu, and with an error; else empty
    std::string interface;                ///< name of the interface that received it
    std::int64_t received_ns = 0;         ///< Unix time of reception
    std::optional<int> rssi_dbm;          ///< signal strength, if known
    std::string source;                   ///< MAC address of the sender, or its name at a broker; empty if unknown
    nlohmann::json reception;             ///< all keys: firmware/reference/topics.md
    std::uint64_t missed = 0;             ///< number of messages of this type that were missed before this one

    /// Return a component by its path, or by the last names of its path: get("speedValue"), get("speed.speedValue").
    /// The names are those of the standard. Throws Error if no component has this path, or several have.
    const nlohmann::json &get(const std::string &path) const;

    /// Read a report of the topics `plain.`, `json.` or `message.`.
    static Message read(Report report);
};

/// Counter of missed messages by the numbers that the station gives to each type, from 1 in each run of the station.
class Gaps {
public:
    /// run: that of the station when the subscription begins.
    explicit Gaps(std::string run) : run_(std::move(run)) {}

    /// Return the number of messages of a type that were missed before this one. Nothing is missed before the first message of a
    /// type, unless the station was restarted meanwhile.
    std::uint64_t before(const std::string &type, const std::string &run, std::uint64_t sequence)
    {
        if (run != run_) {
            is_first_run_ = run_.empty(); // a station without runs in its status
            run_ = run;
            last_.clear();
        }
        const auto found = last_.find(type);
        const std::uint64_t expected = found != last_.end() ? found->second + 1 : is_first_run_ ? sequence : 1;
        last_[type] = sequence;
        return sequence > expected ? sequence - expected : 0;
    }

private:
    std::string run_;
    bool is_first_run_ = true;
    std::map<std::string, std::uint64_t> last_;
};

namespace detail {

constexpr std::size_t header_octets = 6; // protocolVersion, messageID, stationID

/// Return octets from hexadecimal digits; other characters end them.
inline Octets from_hex(const std::string &digits)
{
    Octets octets;
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
        const std::string pair = digits.substr(i, 2);
        if (pair.find_first_not_of("0123456789abcdefABCDEF") != std::string::npos)
            break;
        octets.push_back(static_cast<std::uint8_t>(std::stoul(pair, nullptr, 16)));
    }
    return octets;
}

inline std::optional<std::uint32_t> station_of(const Octets &pdu)
{
    if (pdu.size() < header_octets)
        return std::nullopt;
    std::uint32_t station = 0;
    for (std::size_t i = 2; i < header_octets; ++i)
        station = station << 8 | pdu[i];
    return station;
}

/// Return the stationID of a decoded message; release 2 writes it stationId.
inline std::optional<std::uint32_t> station_of(const nlohmann::json &message)
{
    const auto header = message.find("header");
    if (header == message.end())
        return std::nullopt;
    const auto station = member<std::uint32_t>(*header, "stationID");
    return station ? station : member<std::uint32_t>(*header, "stationId");
}

/// Components of a value by the last names of their paths.
class Search {
public:
    explicit Search(const std::string &path) : wanted_("." + path) {}

    void below(const nlohmann::json &value, const std::string &path)
    {
        for (const auto &[name, component] : value.items()) {
            const std::string its_path = path + "." + name;
            if (its_path.size() >= wanted_.size() && its_path.compare(its_path.size() - wanted_.size(), wanted_.size(), wanted_) == 0)
                found.emplace(its_path.substr(1), &component);
            if (component.is_structured())
                below(component, its_path);
        }
    }

    std::map<std::string, const nlohmann::json *> found; ///< by path

private:
    std::string wanted_;
};

} // namespace detail

inline const nlohmann::json &Message::get(const std::string &path) const
{
    if (!value.is_object())
        throw Error("message." + type + ".: " + (error.empty() ? "not decoded" : error), "listen with Form::plain, and check `error` first");
    detail::Search search(path);
    search.below(value, "");
    const auto whole = search.found.find(path);
    if (whole != search.found.end())
        return *whole->second;
    if (search.found.empty())
        throw Error(edition + ": " + path + ": unknown or absent component", "`value` has all components");
    if (search.found.size() > 1)
        throw Error(edition + ": " + path + ": " + std::to_string(search.found.size()) + " components have this name",
                    "write more of the path, such as " + search.found.begin()->first);
    return *search.found.begin()->second;
}

inline Message Message::read(Report report)
{
    Message message;
    const std::size_t dot = report.topic.find('.') + 1;
    message.type = report.topic.substr(dot, report.topic.find('.', dot) - dot);
    nlohmann::json &object = report.object;
    message.reception = object.contains("reception") ? std::move(object["reception"]) : object;
    message.edition = text(object, "edition");
    message.error = text(object, "error");
    message.pdu = report.octets.empty() ? detail::from_hex(text(object, "pdu")) : std::move(report.octets);
    if (object.contains("message"))
        message.value = std::move(object["message"]);
    message.station = message.pdu.empty() ? detail::station_of(message.value) : detail::station_of(message.pdu);
    message.interface = text(message.reception, "interface");
    message.received_ns = member<std::int64_t>(message.reception, "received_ns").value_or(0);
    message.rssi_dbm = member<int>(message.reception, "rssi_dbm");
    message.source = text(message.reception, "source");
    return message;
}

} // namespace captain_client

#endif
