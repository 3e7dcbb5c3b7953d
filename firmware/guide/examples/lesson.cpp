// lesson.cpp: sends a CAM of own values by station A, and shows it as station B has received it.
#include <captain_client.hpp>
#include <iostream>

int main(int argc, char **argv)
{
    captain_client::Station a(argc > 2 ? argv[1] : ":5555"), b(argc > 2 ? argv[2] : ":5565"); // `make run` has both
    auto messages = b.listen({"cam"});
    std::optional<captain_client::Message> message;
    do {
        a.send("cam", {{"station", 1234}, {"speed", 27.78}, {"latitude", 48.7668}, {"longitude", 11.4321}}).confirmed();
        message = messages.next(std::chrono::milliseconds(100));
    } while (!message || message->station != 1234u);
    std::cout << "station 1234 at " << message->get("speedValue") << " m/s by " << message->interface << '\n';
}
