// Received reports and messages as ranges.
#ifndef CAPTAIN_CLIENT_REPORTS_HPP
#define CAPTAIN_CLIENT_REPORTS_HPP

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "captain_client/connection.hpp"

namespace captain_client {

/// Input iterator: each step waits for the next item of a source. It ends when a signal handler has run.
template <class Source, class Item> class Iterator {
public:
    using iterator_category = std::input_iterator_tag;
    using value_type = Item;
    using difference_type = std::ptrdiff_t;
    using pointer = const Item *;
    using reference = const Item &;

    Iterator() = default;
    explicit Iterator(Source &source) : source_(&source) { ++*this; }
    reference operator*() const { return *item_; }
    pointer operator->() const { return &*item_; }
    Iterator &operator++()
    {
        item_ = source_->next();
        source_ = item_ ? source_ : nullptr;
        return *this;
    }
    void operator++(int) { ++*this; }
    friend bool operator==(const Iterator &left, const Iterator &right) { return left.source_ == right.source_; }
    friend bool operator!=(const Iterator &left, const Iterator &right) { return !(left == right); }

private:
    Source *source_ = nullptr;
    std::optional<Item> item_;
};

/// Reports of some topics.
class Reports {
public:
    Reports(std::shared_ptr<Connection> connection, const std::vector<std::string> &topics)
        : connection_(std::move(connection)), socket_(connection_->subscribed(topics))
    {
    }
    Reports(Reports &&) = default;
    /// The former socket is closed before its connection: libzmq would wait for it.
    Reports &operator=(Reports other) noexcept
    {
        connection_.swap(other.connection_);
        socket_.swap(other.socket_);
        return *this;
    }

    /// Wait for the next report. Returns nothing after the timeout, or when a signal handler has run.
    std::optional<Report> next(std::optional<Milliseconds> timeout = std::nullopt)
    {
        std::optional<Report> report;
        connection_->wait([&] { return (report = take_report(socket_)).has_value(); }, timeout, socket_);
        return report;
    }
    Iterator<Reports, Report> begin() { return Iterator<Reports, Report>(*this); }
    Iterator<Reports, Report> end() { return {}; }

private:
    std::shared_ptr<Connection> connection_;
    zmq::socket_t socket_;
};

/// Received messages of some types.
class Listener {
public:
    Listener(std::shared_ptr<Connection> connection, const std::vector<std::string> &types, Form form)
        : connection_(connection), reports_(std::move(connection), topics(types, form)), gaps_(connection_->run())
    {
        for (const std::string &type : types)
            check(type);
    }

    /// Wait for the next message. Returns nothing after the timeout, or when a signal handler has run.
    std::optional<Message> next(std::optional<Milliseconds> timeout = std::nullopt)
    {
        std::optional<Report> report = reports_.next(timeout);
        if (!report)
            return std::nullopt;
        Message message = Message::read(std::move(*report));
        if (const auto sequence = member<std::uint64_t>(message.reception, "sequence"))
            message.missed = gaps_.before(message.type, text(message.reception, "run"), *sequence);
        connection_->missed += message.missed;
        return message;
    }
    Iterator<Listener, Message> begin() { return Iterator<Listener, Message>(*this); }
    Iterator<Listener, Message> end() { return {}; }

private:
    /// Throw std::invalid_argument if the station does not know a type. The last status may be older than an added type.
    void check(const std::string &type)
    {
        const auto is_unknown = [&](const nlohmann::json &known) {
            return !type.empty() && known.is_array() && std::find(known.begin(), known.end(), type) == known.end();
        };
        if (!is_unknown(connection_->types()))
            return;
        connection_->next_status();
        if (const nlohmann::json known = connection_->types(); is_unknown(known))
            throw std::invalid_argument("message type '" + type + "': unknown to the station; known: " + known.dump());
    }

    static std::vector<std::string> topics(const std::vector<std::string> &types, Form form)
    {
        const std::string first = form == Form::plain ? "plain." : form == Form::json ? "json." : "message.";
        if (types.empty())
            return {first};
        std::vector<std::string> topics;
        for (const std::string &type : types) {
            if (type.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos)
                throw std::invalid_argument("invalid message type '" + type + "'; write it as in a topic, such as cam");
            topics.push_back(first + type + ".");
        }
        return topics;
    }

    std::shared_ptr<Connection> connection_;
    Reports reports_;
    Gaps gaps_;
};

} // namespace captain_client

#endif
