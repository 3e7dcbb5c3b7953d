"""Options of a key in authorized_keys: what sshd takes, what it passes the line over for, and what shuts a key."""

import pytest
from hypothesis import given
from hypothesis import strategies as some

from firmware.box.ssh_keys import shut
from firmware.box.ssh_options import CHECKS
from tests.firmware.box.conftest import KEY, keys_of


@pytest.mark.parametrize(
    "options",
    [
        'from="127.0.0.1"', 'from="127.0.0.0/24,!10.*,host.example,fe80::/10"', 'from="!10.0.0.0/8,*"', 'FROM="*"',
        'from="2001:DB8::/32,2001:db8:0:0::/64,::ffff:10.0.0.0/104,10.0.0.0/08,fe80::1%lo/128"',
        'environment="A=b",environment="A=c"', 'environment="A="', 'expiry-time="20990101z"', 'expiry-time="209901011200UTC"',
        'permitopen="x:1"', 'permitopen="x:*",permitopen="x:2"', 'permitopen="[::1]:80"', 'permitopen="*:*"',
        'permitopen=":80"', 'permitopen="x/80"', 'permitopen="x:080"', 'permitlisten="80"', 'permitlisten="*"',
        'permitlisten="x:80"', 'permitlisten="[::]:80"', 'permitlisten=":80"', 'tunnel="any"', 'tunnel="ANY"',
        'tunnel="2147483645"', 'tunnel="0",tunnel="1"', "no-verify-required", "touch-required", "restrict,restrict",
        "restrict,", 'command=""', r'command="a\" b"', r'command="a\\" b"', 'cert-authority,principals="operator"',
    ],
)  # fmt: skip
def test_what_sshd_takes_is_taken(options: str):
    assert keys_of(f"{options} {KEY}") == ([f"{options} {KEY}"], [])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ('from="192.168.1.5/24"', 'from="192.168.1.5/24" is no list of hosts; write 192.168.1.0/24 for 192.168.1.5/24'),
        ('from="10.0.0.1,127.0.0.0/33"', 'from="10.0.0.1,127.0.0.0/33" is no list of hosts; 127.0.0.0/33 is no network; write one as 10.0.0.0/8'),
        ('from="10.0.0.0/255.0.0.0,*"', "write 10.0.0.0/8 for 10.0.0.0/255.0.0.0"),
        ('from="*.example/24,*"', "*.example/24 is no network"),
        (f'from="10.0.0.0/{"1" * 6000}"', f"10.0.0.0/{'1' * 31}... is no network"),
        ('from="127.0.0.1,"', "write a host between two commas"),
        ('from="!"', "write a host between two commas"),
        ('from=""', "write a host between two commas"),
        ('from="*, 127.0.0.1"', 'write no blank into " 127.0.0.1"'),
        ('environment="PATH"', 'environment="PATH" is no variable; write environment="NAME=value"'),
        ('environment="A-B=c"', "is no variable"),
        ('environment="=c"', "is no variable"),
        ('environment=" A=b"', "is no variable"),
        ('permitopen="x"', 'permitopen="x" is no host and port; write permitopen="HOST:PORT"'),
        ('permitopen="x:0"', "is no host and port"),
        ('permitopen="x:65536"', "is no host and port"),
        ('permitopen="::1:80"', "is no host and port"),
        ('permitopen="a:1:2"', "is no host and port"),
        ('permitlisten="x"', 'permitlisten="x" is no port; write permitlisten="PORT"'),
        ('permitlisten="0"', "is no port"),
        ('permitlisten="x/80"', "is no port"),
        (f'permitlisten="{"0" * 6000}1"', "is no port"),
        ('tunnel="x"', 'tunnel="x" is no device; write the number of a tun device'),
        ('tunnel="1:2"', "is no device"),
        ('tunnel="2147483646"', "is no device"),
        ('tunnel=""', "is no device"),
        ('command="a",command="b"', "command is there 2 times, and sshd takes it once; write one command"),
        ('from="a",restrict,From="a"', "from is there 2 times"),
        ('principals="operator"', "principals is for an authority's key; leave it out, or write cert-authority before it"),
        ("no-cert-authority", '"no-cert-authority" is no option of a key'),
        ("restrict,no-ptyy", '"no-ptyy" is no option of a key'),
        ("restrict,,pty", '",pty" is no option of a key'),
        ("no-restrict", '"no-restrict" is no option of a key'),
        (f'environment="{"A" * 99}"', f'environment="{"A" * 27}... is no variable'),
        ('command="\ufffd"', "an option has an octet that is not UTF-8"),
    ],
)  # fmt: skip
def test_what_sshd_passes_over_or_can_never_fit_is_told_with_what_to_write(options: str, said: str):
    keys, (told,) = keys_of(f"{options} {KEY}")
    assert keys == []
    assert said in told


@given(options=some.text(max_size=60), value=some.text(max_size=60), name=some.sampled_from(sorted(CHECKS)))
def test_any_options_are_taken_or_told(options: str, value: str, name: str):
    for line in (f"{options} {KEY}", f'{name}="{value}" {KEY}'):
        keys, told = keys_of(line)
        assert len(keys) + len(told) <= line.count("\n") + 1


NOON = 1_764_072_000.0  # 2025-11-25T12:00:00Z


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ("restrict ", ""),
        ("", ""),
        ('expiry-time="20251126Z" ', ""),
        ('expiry-time="20251125Z" ', "has expired: expiry-time is 20251125"),
        ('expiry-time="202511251200Z" ', "has expired: expiry-time is 202511251200"),
        ('expiry-time="20251125120001Z" ', ""),
        # The box's own time may be twelve hours behind.
        ('expiry-time="202511250001" ', ""),
        ('expiry-time="99991231235959" ', ""),
        ('expiry-time="20300101",expiry-time="20200101" ', "has expired: expiry-time is 20200101"),
        ('expiry-time="20250101Z",expiry-time="20200101UTC" ', "has expired: expiry-time is 20200101"),
        ('no-pty,Expiry-Time="202511250000" ', "has expired: expiry-time is 202511250000"),
        ('from="!10.0.0.1,!10.0.0.2" ', "lets nobody in: from names only who is shut out, !10.0.0.1,!10.0.0.2"),
        ('from="!10.0.0.1,*" ', ""),
        ("cert-authority ", "is an authority's: only a certificate that it has signed for operator gets in"),
        ('no-pty,CERT-AUTHORITY,principals="operator" ', "is an authority's: only a certificate that it has signed for operator gets in"),
        ('command="a,cert-authority,b \\"expiry-time=\\"20010101\\"\\"" ', ""),
    ],
)  # fmt: skip
def test_a_key_by_which_nobody_gets_in_is_told(options: str, why: str):
    line = f"{options}{KEY}"
    assert keys_of(line) == ([line], [])
    assert shut(line, NOON) == why


@pytest.mark.parametrize("time", ["tomorrow", "2025-11-25", "20251325", "202511250", "20301231246000", ""])
def test_an_expiry_time_that_sshd_cannot_read_is_a_mistake(time: str):
    written = f'expiry-time="{time}"'
    keys, (said,) = keys_of(f"{written} {KEY}")
    assert keys == []
    assert said.startswith(f"authorized_keys:1: {written} is no time; write YYYYMMDD")
