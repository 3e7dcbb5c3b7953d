// Connection with a station: its sockets and their waits. One thread at a time may use it.
#ifndef CAPTAIN_CLIENT_CONNECTION_HPP
#define CAPTAIN_CLIENT_CONNECTION_HPP

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <zmq.hpp>

#include "captain_client/address.hpp"
#include "captain_client/requests.hpp"

namespace captain_client {

using Milliseconds = std::chrono::milliseconds;

/// Call again if a signal handler has interrupted the call.
template <class Call> auto uninterrupted(Call call)
{
    for (;;) {
        try {
            return call();
        } catch (const zmq::error_t &error) {
            if (error.num() != EINTR)
                throw;
        }
    }
}

class Connection {
public:
    /// Connect, and wait until the station answers. Throws UnreachableError if it does not within the timeout.
    Connection(Address address, Milliseconds timeout)
        : address_(std::move(address)), timeout_(timeout), connections_(context_, zmq::socket_type::pair),
          push_(connected(zmq::socket_type::push, address_.push())),
          reports_(subscribed({"confirm.", "status."}, high_water_of_reports))
    {
        wait_for_status(0);
        if (!is_ready(connections_, ZMQ_POLLIN, timeout_))
            throw unreachable(address_.push());
        has_connected(); // later connections are interruptions
    }

    static constexpr int high_water = 10'000; // messages that a listener queues: 10 s at 1,000 per second

    /// Return a socket that is subscribed to topics. It queues `most` messages; libzmq discards further ones.
    zmq::socket_t subscribed(const std::vector<std::string> &topics, int most = high_water)
    {
        zmq::socket_t socket = connected(zmq::socket_type::sub, address_.report(), most);
        for (const std::string &topic : topics)
            socket.set(zmq::sockopt::subscribe, topic);
        return socket;
    }

    /// Send a request and return it. Throws UnreachableError if the station does not take it, Error if it is too long.
    std::shared_ptr<Request> send(const std::string &type, const void *body, std::size_t octets, nlohmann::json options)
    {
        check_length(type, octets);
        wait_for_push();
        const auto request = requests_.open(type, std::chrono::steady_clock::now());
        options["label"] = request->label;
        const std::string envelope = type.empty() ? "v2x." : "v2x." + type + ".", last = options.dump();
        check_length(type + ": options", last.size());
        if (!sends(zmq::buffer(envelope), zmq::send_flags::sndmore))
            throw unreachable(address_.push());
        // If the connection ends meanwhile, libzmq discards the remaining frames, which it must get for this purpose.
        const bool has_body = sends(zmq::const_buffer(body, octets), zmq::send_flags::sndmore);
        const bool has_options = sends(zmq::buffer(last), zmq::send_flags::none);
        if (!has_body || !has_options)
            throw unreachable(address_.push());
        return request;
    }

    /// Wait until done() returns true. Returns false after the timeout, or when a signal handler has run.
    ///   timeout  forever if absent.
    ///   also     a further socket that ends the pause between two calls of done().
    template <class Done> bool wait(Done done, std::optional<Milliseconds> timeout, zmq::socket_ref also = {})
    {
        const auto start = std::chrono::steady_clock::now();
        for (;;) {
            take_reports();
            if (done())
                return true;
            Milliseconds left{-1};
            if (timeout) {
                left = *timeout - std::chrono::duration_cast<Milliseconds>(std::chrono::steady_clock::now() - start);
                if (left <= Milliseconds::zero())
                    return false;
            }
            zmq::pollitem_t items[] = {{reports_.handle(), 0, ZMQ_POLLIN, 0}, {also.handle(), 0, ZMQ_POLLIN, 0}};
            if (!poll(items, also ? 2 : 1, left))
                return false;
        }
    }

    /// Return the next status. Throws UnreachableError after the timeout.
    const nlohmann::json &next_status()
    {
        take_reports();
        wait_for_status(statuses_);
        return status_;
    }

    /// Return the station's message types, from its last status; null for a station of an older release.
    nlohmann::json types() const { return status_.value("types", nlohmann::json()); }

    /// Return the run of the station, from its last status.
    const std::string &run() const { return requests_.run(); }

    std::uint64_t missed = 0; ///< messages that this client has missed

private:
    static constexpr std::size_t most_octets = 0xFFFF;   // libzmq in the station ends the connection at a longer frame
    static constexpr std::int64_t most_received = 1 << 20; // octets: a status of a hundred interfaces has 100 kB
    static constexpr int high_water_of_reports = 1000;     // confirms and statuses of an idle program: some 2 MB
    static constexpr int linger_ms = 1000;                 // a program that sends and ends at once
    // ZMTP heartbeats detect a station that has lost its power or network: TCP does not notice.
    static constexpr int heartbeat_ms = 1000, heartbeat_timeout_ms = 3000;
    // Time limit for the event of a connection, which libzmq sends some us after the socket is writable.
    static constexpr Milliseconds event_delay{100};

    zmq::socket_t connected(zmq::socket_type type, const std::string &endpoint, int most = high_water)
    {
        zmq::socket_t socket(context_, type);
        socket.set(zmq::sockopt::ipv6, true);
        socket.set(zmq::sockopt::rcvhwm, most);
        socket.set(zmq::sockopt::maxmsgsize, most_received);
        socket.set(zmq::sockopt::heartbeat_ivl, heartbeat_ms);
        socket.set(zmq::sockopt::heartbeat_timeout, heartbeat_timeout_ms);
        socket.set(zmq::sockopt::heartbeat_ttl, heartbeat_timeout_ms);
        socket.set(zmq::sockopt::linger, type == zmq::socket_type::push ? linger_ms : 0);
        if (type == zmq::socket_type::push) {
            socket.set(zmq::sockopt::sndtimeo, 0);     // send() polls first
            socket.set(zmq::sockopt::immediate, true); // queues no old messages for a station that starts later
            watch(socket);
        }
        try {
            socket.connect(endpoint);
        } catch (const zmq::error_t &error) {
            throw std::invalid_argument("station: " + endpoint + ": invalid host: " + error.what());
        }
        return socket;
    }

    /// Wait until more than `before` statuses have come.
    void wait_for_status(unsigned long before)
    {
        if (!wait([&] { return statuses_ > before; }, timeout_))
            throw unreachable(address_.report());
    }

    /// Wait until the station takes messages. After an interruption a status must come as well: it proves that the station has
    /// the subscriptions again. Without them, confirms would be lost.
    void wait_for_push()
    {
        for (;;) {
            if (!is_ready(push_, ZMQ_POLLOUT, Milliseconds::zero())) {
                if (!is_ready(push_, ZMQ_POLLOUT, timeout_))
                    throw unreachable(address_.push());
                is_ready(connections_, ZMQ_POLLIN, event_delay);
            }
            if (has_connected())
                is_interrupted_ = true;
            take_reports(); // those of the former run prove nothing
            if (!is_interrupted_)
                return;
            wait_for_status(statuses_);
            is_interrupted_ = false;
        }
    }

    /// Count the connections of a push socket by events of libzmq. A connection counts after the handshake: a proxy without its
    /// station accepts and ends ten connections per second.
    void watch(zmq::socket_t &push)
    {
        const char *const connections = "inproc://connections";
        if (zmq_socket_monitor(push.handle(), connections, ZMQ_EVENT_HANDSHAKE_SUCCEEDED) != 0)
            throw zmq::error_t();
        connections_.set(zmq::sockopt::rcvhwm, 0); // a full queue of events would stop all sockets of the context
        connections_.connect(connections);
    }

    /// Return true if there is a new connection since the last call.
    bool has_connected()
    {
        bool found = false;
        for (zmq::message_t event; uninterrupted([&] { return connections_.recv(event, zmq::recv_flags::dontwait); });)
            found = true;
        return found;
    }

    /// Wait for an event of a socket; return false after the timeout, or if a signal handler has run.
    static bool is_ready(zmq::socket_t &socket, short event, Milliseconds timeout)
    {
        zmq::pollitem_t item{socket.handle(), 0, event, 0};
        return poll(&item, 1, timeout) && item.revents != 0;
    }

    static void check_length(const std::string &what, std::size_t octets)
    {
        if (octets > most_octets)
            throw Error(what + ": " + std::to_string(octets) + " octets; too long", "the limit is " + std::to_string(most_octets));
    }

    bool sends(zmq::const_buffer frame, zmq::send_flags flags)
    {
        return uninterrupted([&] { return push_.send(frame, flags).has_value(); });
    }

    /// Poll; return false if a signal handler has run.
    static bool poll(zmq::pollitem_t *items, std::size_t count, Milliseconds timeout)
    {
        try {
            zmq::poll(items, count, timeout);
        } catch (const zmq::error_t &error) {
            if (error.num() != EINTR)
                throw;
            return false;
        }
        return true;
    }

    /// Take all waiting confirms and statuses.
    void take_reports();

    UnreachableError unreachable(const std::string &endpoint) const
    {
        return UnreachableError(endpoint + ": the station does not answer", "start one with `captain run`, or check host and port");
    }

    Address address_;
    Milliseconds timeout_;
    zmq::context_t context_;
    zmq::socket_t connections_, push_, reports_; // connections_: events of libzmq, the connections of push_
    bool is_interrupted_ = false;                // push_ has connected again since the last status that was waited for
    Requests requests_;
    nlohmann::json status_;
    unsigned long statuses_ = 0; // number of received statuses
};

/// Return the next report of a socket that has one: nothing if none waits, or if it is invalid.
inline std::optional<Report> take_report(zmq::socket_t &socket)
{
    std::vector<zmq::message_t> frames;
    do {
        zmq::message_t &frame = frames.emplace_back();
        if (!uninterrupted([&] { return socket.recv(frame, zmq::recv_flags::dontwait); }))
            return std::nullopt;
    } while (frames.back().more());
    if (frames.size() < 2)
        return std::nullopt;
    Report report{frames[0].to_string(), nlohmann::json::parse(frames[1].to_string_view(), nullptr, false), {}};
    if (!report.object.is_object())
        return std::nullopt;
    if (frames.size() > 2)
        report.octets.assign(frames[2].data<std::uint8_t>(), frames[2].data<std::uint8_t>() + frames[2].size());
    return report;
}

inline void Connection::take_reports()
{
    while (auto report = take_report(reports_)) {
        if (report->topic != "status.") {
            requests_.confirm(report->object);
            continue;
        }
        status_ = std::move(report->object);
        ++statuses_;
        requests_.status(status_, std::chrono::steady_clock::now());
    }
}

} // namespace captain_client

#endif
