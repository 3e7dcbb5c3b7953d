// Example for a CAM: makes one, encodes it, decodes it again and reads it by views.
#include <captain/r1_cam.hpp>

#include <cstdio>
#include <iostream>

static std::vector<std::uint8_t> make()
{
    const captain_message &message = captain::find("cam-1.4.1");
    captain::message<r1_cam_CAM> cam;
    cam.read_example(message); // a legal message, whose values are unavailable
    cam.set(message, "latitude", "47.0654321"); // degrees
    cam.set(message, "longitude", "15.4512345");
    cam.set(message, "speed", "13.9");           // m/s
    cam->header.stationID = 4711;                // the C struct
    cam->cam.camParameters.basicContainer.stationType = 5;
    return cam.encode();
}

int main()
try {
    std::vector<std::uint8_t> octets = make();
    for (std::uint8_t octet : octets)
        std::printf("%02x", octet);
    std::printf("\n");

    auto cam = captain::message<r1_cam_CAM>::decode(octets);
    auto parameters = cam.view().cam().camParameters();
    std::cout << "station " << cam->header.stationID << " at "
              << parameters.basicContainer().referencePosition().latitude() / 1e7 << " degrees north\n";
    parameters.highFrequencyContainer().visit([](auto container) {
        if constexpr (std::is_same_v<decltype(container), captain::view<r1_cam_BasicVehicleContainerHighFrequency>>)
            std::cout << "speed " << container.speed().speedValue() / 100.0 << " m/s\n";
        else
            std::cout << "no vehicle\n";
    });
    if (auto low = parameters.lowFrequencyContainer())
        std::cout << "has a low frequency container\n";
    cam.validate();
    std::cout << cam.text();
    return 0;
} catch (const captain::error &error) {
    std::cerr << error.what() << '\n';
    return 1;
}
