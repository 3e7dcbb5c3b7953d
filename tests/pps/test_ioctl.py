"""The PPS ioctls: numbers, layouts and octets as a C program has them that is compiled with linux/pps.h."""

import struct
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pps.ioctl import FDATA, PPS_FETCH, PPS_GETCAP, PPS_GETPARAMS, fetch, layout, number
from tests.pps import kernel as linux
from tests.pps.kernel import CANWAIT, CAPTUREASSERT, CAPTURECLEAR

S = 1_700_000_000  # a moment of the system's clock

HEADER = r"""
#include <linux/pps.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

int main(void) {
    struct pps_fdata f;
    printf("%lx %lx %lx\n", (unsigned long)PPS_GETPARAMS, (unsigned long)PPS_GETCAP, (unsigned long)PPS_FETCH);
    printf("%zu %zu %zu\n", sizeof(struct pps_kparams), sizeof(struct pps_fdata), sizeof(struct pps_fdata_compat));
    printf("%zu %zu %zu %zu %zu %zu\n", offsetof(struct pps_fdata, info.clear_sequence),
        offsetof(struct pps_fdata, info.assert_tu), offsetof(struct pps_fdata, info.clear_tu),
        offsetof(struct pps_fdata, info.current_mode), offsetof(struct pps_fdata, timeout),
        offsetof(struct pps_kparams, mode));
    printf("%zu %zu %zu %zu\n", offsetof(struct pps_fdata_compat, info.clear_tu),
        offsetof(struct pps_fdata_compat, info.current_mode), offsetof(struct pps_fdata_compat, timeout),
        offsetof(struct pps_fdata_compat, timeout.flags));
    printf("%x %x %x\n", PPS_CAPTUREASSERT, PPS_CAPTURECLEAR, PPS_CANWAIT);
    if (fread(&f, sizeof f, 1, stdin) != 1) return 1;
    printf("%u %u %lld %d %lld %d %d %lld %d %u\n", f.info.assert_sequence, f.info.clear_sequence,
        (long long)f.info.assert_tu.sec, f.info.assert_tu.nsec, (long long)f.info.clear_tu.sec, f.info.clear_tu.nsec,
        f.info.current_mode, (long long)f.timeout.sec, f.timeout.nsec, f.timeout.flags);
    memset(&f, 0, sizeof f);
    f.info.assert_sequence = 0xfedcba98; f.info.clear_sequence = 7;
    f.info.assert_tu.sec = -2; f.info.assert_tu.nsec = 3; f.info.assert_tu.flags = 4;
    f.info.clear_tu.sec = 5000000000; f.info.clear_tu.nsec = 6; f.info.clear_tu.flags = 8;
    f.info.current_mode = 9; f.timeout.sec = 10; f.timeout.nsec = 11; f.timeout.flags = 12;
    for (size_t i = 0; i < sizeof f; i++) printf("%02x", ((unsigned char *)&f)[i]);
    return 0;
}
"""


@pytest.fixture(scope="module")
def header(tmp_path_factory):
    """What a C program with linux/pps.h says, line by line, of one struct that is ours."""
    folder = tmp_path_factory.mktemp("pps")
    (folder / "pps.c").write_text(HEADER)
    subprocess.run(["gcc", "-o", folder / "pps", folder / "pps.c"], check=True)
    ours = FDATA.pack(2**32 - 1, 4, S, 999_999_999, 0, -5, 123, 6, 0x1151, 1, 500_000_000, 1)
    return subprocess.run([folder / "pps"], input=ours, capture_output=True, check=True).stdout.decode().splitlines()


def test_the_numbers_are_those_of_the_kernels_header(header):
    assert [int(word, 16) for word in header[0].split()] == [PPS_GETPARAMS, PPS_GETCAP, PPS_FETCH]
    assert [int(word, 16) for word in header[4].split()] == [CAPTUREASSERT, CAPTURECLEAR, CANWAIT]


def test_structs_are_laid_out_as_in_the_kernels_header(header):
    assert header[1] == f"{linux.KPARAMS.size} {FDATA.size} 60"
    assert header[2] == "4 8 24 40 48 4"


def test_a_struct_of_ours_is_read_by_c_as_it_is_meant(header):
    assert header[5] == f"{2**32 - 1} 4 {S} 999999999 -5 123 {0x1151} 1 500000000 1"


def test_a_struct_of_c_is_read_as_it_is_meant(header):
    octets = bytes.fromhex(header[6])
    fields = (0xFEDCBA98, 7, -2, 3, 4, 5_000_000_000, 6, 8, 9, 10, 11, 12)
    assert FDATA.unpack(octets) == fields
    assert FDATA.pack(*fields) == octets
    assert linux.FDATA.pack(*fields) == octets


@pytest.mark.parametrize("machine", ["aarch64", "armv8l", "x86_64"])
def test_a_kernel_of_64_bits_has_another_layout_for_programs_of_32(header, machine):
    assert (layout(4, machine), layout(8, machine)) == ("=", "@")
    octets = struct.pack("=IIqiIqiIiqiI", 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)
    assert len(octets) == 60
    offsets = [int(word) for word in header[3].split()]
    assert [octets.find(n.to_bytes(4, "little")) for n in (6, 9, 10, 12)] == offsets


def test_a_kernel_of_32_bits_has_the_compilers_layout():
    assert (layout(4, "armv7l"), layout(4, "i686")) == ("@", "@")


@given(octets=st.binary(min_size=FDATA.size, max_size=FDATA.size))
def test_whatever_the_kernel_writes_is_read(octets):
    def ioctl(device, number, into):
        into[:] = octets

    fetched = fetch(ioctl, 0, 0)
    assert octets[:8] == struct.pack("=II", fetched.sequences["assert"], fetched.sequences["clear"])


def test_a_program_of_32_bits_has_other_numbers():
    # The kernel's compat_ioctl, and every kernel of 32 bits: the macros name the size of a pointer.
    assert [number(2, 0xA1, 4), number(2, 0xA3, 4), number(3, 0xA4, 4)] == [0x800470A1, 0x800470A3, 0xC00470A4]
