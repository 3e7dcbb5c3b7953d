// Example: converts between octets and JSON for any message: json MESSAGE HEX, or json MESSAGE '{...}'.
#include <captain/messages.hpp>

#include <cstdio>
#include <iostream>
#include <string>

static std::vector<std::uint8_t> from_hex(const std::string &text)
{
    std::vector<std::uint8_t> octets;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
        octets.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
    return octets;
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        std::cerr << "usage: json MESSAGE HEX|JSON\n";
        return 2;
    }
    try {
        const captain_message &message = captain::find(argv[1]);
        const std::string text = argv[2];
        if (text.front() == '{') {
            for (std::uint8_t octet : captain::value::from_json(*message.pdu, text).encode())
                std::printf("%02x", octet);
            std::printf("\n");
        } else {
            std::cout << captain::value::decode(*message.pdu, from_hex(text)).json() << '\n';
        }
    } catch (const std::exception &error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
    return 0;
}
