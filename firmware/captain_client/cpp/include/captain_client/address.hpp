// Address of a station: its host and the first of its ports.
#ifndef CAPTAIN_CLIENT_ADDRESS_HPP
#define CAPTAIN_CLIENT_ADDRESS_HPP

#include <stdexcept>
#include <string>

namespace captain_client {

struct Address {
    static constexpr int first_port = 5555, last_port = 0xFFFF;

    std::string host = "127.0.0.1"; ///< a name, an IPv4 address, or an IPv6 address in brackets
    int first = first_port;

    std::string push() const { return endpoint(2); }   ///< port for messages to send
    std::string report() const { return endpoint(3); } ///< port of reports

    /// Parse HOST, HOST:PORT, :PORT or [V6]:PORT. Throws std::invalid_argument for any other text.
    static Address parse(const std::string &text);

private:
    std::string endpoint(int offset) const { return "tcp://" + host + ":" + std::to_string(first + offset); }
};

inline Address Address::parse(const std::string &text)
{
    const auto invalid = [&text](const std::string &problem) { return std::invalid_argument("station: \"" + text + "\": " + problem); };
    const char *const digits = "0123456789";
    if (text.find("://") != std::string::npos)
        throw invalid("invalid host and port; write HOST:PORT without a scheme");
    if (!text.empty() && text.find_first_not_of(digits) == std::string::npos)
        throw invalid("a port without a colon; write :" + text);
    const bool has_bracket = !text.empty() && text.front() == '[';
    const std::size_t end = has_bracket ? text.find(']') + 1 : text.find(':');
    const std::string host = text.substr(0, end);
    const std::string rest = end == std::string::npos ? "" : text.substr(end);
    if ((has_bracket && (end == 0 || end == 2)) || host.find_first_of(" /@") != std::string::npos)
        throw invalid("invalid host; write HOST:PORT, or [V6]:PORT");
    Address address;
    if (!host.empty())
        address.host = host;
    if (rest.empty())
        return address;
    const std::string port = rest.substr(1);
    if (rest.front() != ':' || port.empty() || port.size() > 5 || port.find_first_not_of(digits) != std::string::npos)
        throw invalid("invalid port; 1 to 65532");
    address.first = std::stoi(port);
    if (address.first < 1 || address.first + 3 > last_port)
        throw invalid("port out of range; 1 to 65532, because three more ports follow");
    return address;
}

} // namespace captain_client

#endif
