// structs.cpp: sends a CAM as a C struct of captain_messages, and reads received octets as such a struct.
#include <captain/r1_cam.hpp> // cam-1.4.1
#include <captain_client.hpp>
#include <iostream>

int main(int argc, char **argv)
{
    captain_client::Station a(argc > 2 ? argv[1] : ":5555"), b(argc > 2 ? argv[2] : ":5565"); // `make run` has both
    auto messages = b.listen({"cam"}, captain_client::Form::pdu);
    captain::message<r1_cam_CAM> own;
    own.read_example(captain::find("cam-1.4.1"));
    own->header.stationID = 1234;
    own->cam.camParameters.highFrequencyContainer.u.basicVehicleContainerHighFrequency.speed.speedValue = 2778; // cm/s
    std::optional<captain_client::Message> message;
    do {
        a.send_pdu("cam", own.encode()).confirmed();
        message = messages.next(std::chrono::milliseconds(100));
    } while (!message || message->station != 1234u);
    const auto cam = captain::message<r1_cam_CAM>::decode(message->pdu);
    std::cout << "station " << cam->header.stationID << ", interface " << message->interface << '\n' << cam.text();
}
