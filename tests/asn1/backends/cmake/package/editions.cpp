// CPM, DENM and CAM of both releases in one program: decodes lines "MESSAGE HEX" of standard input, and prints a few fields
// of each by its own types. Every message has to come back: octets, JSON, and the same when it is decoded once more.
#include <captain/r1_cam.hpp>
#include <captain/r1_cpm.hpp>
#include <captain/r1_denm.hpp>
#include <captain/r2_cam231.hpp>
#include <captain/r2_cpm211.hpp>
#include <captain/r2_cpmobject211.hpp>
#include <captain/r2_denm231.hpp>

#include <iostream>
#include <stdexcept>

using octet_string = std::vector<std::uint8_t>;

static octet_string from_hex(const std::string &text)
{
    octet_string octets;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
        octets.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
    return octets;
}

template <class T> captain::message<T> decoded(const octet_string &octets)
{
    auto message = captain::message<T>::decode(octets);
    if (message.encode() != octets)
        throw std::runtime_error("encodes to other octets");
    if (captain::message<T>::from_json(message.json()) != message)
        throw std::runtime_error("comes back from JSON as another value");
    captain::message<T> again;
    again.read_plain_json(message.plain_json());
    if (again != message)
        throw std::runtime_error("comes back from plain JSON as another value");
    if (again.try_read(octets) != CAPTAIN_OK || again != message || again.text() != message.text())
        throw std::runtime_error("decodes to another value");
    std::vector<captain::message<T>> kept;
    kept.push_back(std::move(again));
    again.read(octets); // what was moved from begins anew
    if (kept.back() != again)
        throw std::runtime_error("is another value where it was moved to");
    kept.clear();
    if (again.encode() != octets)
        throw std::runtime_error("lies in memory of where it was moved to");
    return message;
}

static void show(const std::string &name, const octet_string &octets)
{
    if (name == "cam-1.4.1") {
        auto cam = decoded<r1_cam_CAM>(octets);
        auto parameters = cam.view().cam().camParameters();
        auto high = parameters.highFrequencyContainer().basicVehicleContainerHighFrequency();
        std::cout << cam->header.stationID << ' ' << parameters.basicContainer().referencePosition().latitude() << ' '
                  << high.value().speed().speedValue();
    } else if (name == "denm-1.3.1") {
        auto denm = decoded<r1_denm_DENM>(octets);
        auto situation = denm.view().denm().situation();
        std::cout << denm->header.stationID << ' ' << situation.value().eventType().causeCode() << ' '
                  << denm.view().denm().location().value().traces().size();
    } else if (name == "cpm-tr-2.1.1") {
        auto cpm = decoded<r1_cpm_CPM>(octets);
        auto parameters = cpm.view().cpm().cpmParameters();
        std::cout << cpm->header.stationID << ' ' << parameters.managementContainer().referencePosition().latitude() << ' '
                  << parameters.perceivedObjectContainer().value().size();
    } else if (name == "cam-2.3.1") {
        auto cam = decoded<r2_cam231_CAM>(octets);
        std::cout << cam->header.stationId << ' '
                  << cam.view().cam().camParameters().basicContainer().referencePosition().latitude();
    } else if (name == "denm-2.3.1") {
        auto denm = decoded<r2_denm231_DENM>(octets);
        std::cout << denm->header.stationId << ' ' << denm.view().denm().management().eventPosition().latitude();
    } else if (name == "cpm-2.1.1") {
        auto cpm = decoded<r2_cpm211_CollectivePerceptionMessage>(octets);
        auto payload = cpm.view().payload();
        std::cout << cpm->header.stationId << ' ' << payload.managementContainer().referencePosition().latitude() << ' '
                  << payload.cpmContainers().size();
        for (auto container : payload.cpmContainers())
            if (auto perceived = container.containerData().as<r2_cpmobject211_PerceivedObjectContainer>())
                for (auto object : perceived->perceivedObjects())
                    std::cout << ' ' << object.position().xCoordinate().value();
    } else {
        throw std::runtime_error("is none of ours");
    }
}

// Memory that was moved from has nothing, and its whole limit before it.
static void check_moves()
{
    captain::memory first(4096);
    first.take(3000);
    captain::memory second = std::move(first);
    first.take(3000);
    second = std::move(first);
    first.take(3000);
}

int main()
{
    check_moves();
    std::string name, hex;
    int status = 0;
    while (std::cin >> name >> hex) {
        try {
            std::cout << name << ' ' << std::flush;
            show(name, from_hex(hex));
        } catch (const captain::error &error) {
            std::cout << "error: " << error.what();
        } catch (const std::exception &error) {
            std::cout << "FAILED: " << error.what();
            status = 1;
        }
        std::cout << '\n';
    }
    return status;
}
