# U-Boot's script, the same on a Raspberry Pi and in QEMU's virt. It selects a slot with tries left, decrements its
# tries in the state partition, and starts its kernel. A healthy station restores the tries; a slot that never gets
# healthy uses them up, and the other slot starts. This script keeps two variables for the judge: BOOT_NEW names a slot
# on trial, and BOOT_AGAIN names a slot that had used up its tries and got one more.
#
# The state: two copies of 4 KiB, 4 MiB apart, in libubootenv's format of a redundant environment: CRC-32 in 4 octets, a
# counter in one octet, the text. U-Boot's own functions expect no counter, so the CRC is moved by one octet for them.
# Only the older copy is written. Its content fits a sector, so a power cut leaves the old copy or the new one.
#
# Notes on this shell: '...' within "..." does not quote; setexpr returns hexadecimal numbers without 0x.

if test "${board}" = "qemu-arm"; then
  setenv console "console=ttyAMA0"
else
  # The built-in addresses are not used, because a Pi 3's device tree at 0x08000000 would overlap the kernel.
  setenv kernel_addr_r 0x0a000000
  setenv ramdisk_addr_r 0x10000000
  setenv console "console=tty0 console=@CONSOLE@"
fi
setenv text_size 0xfff
setenv blocks 8
setenv apart 0x2000

# Memory: copy 1, copy 2, and a work area; for each, the addresses of text and counter.
setenv a ${ramdisk_addr_r}
setexpr b ${a} + 0x10000
setexpr work ${a} + 0x20000
setexpr a_text ${a} + 1
setexpr b_text ${b} + 1
setexpr work_text ${work} + 1
setexpr a_count ${a} + 4
setexpr b_count ${b} + 4
setexpr work_count ${work} + 4

${devtype} dev ${devnum}
part start ${devtype} ${devnum} 5 first
setenv first 0x${first}
setexpr second ${first} + ${apart}
setenv second 0x${second}
setenv a_good 0
setenv b_good 0
mw.b ${a} 0 0x20000
${devtype} read ${a} ${first} ${blocks}
setexpr.b a_counter *${a_count}
cp.b ${a} ${work} 4
cp.b ${work} ${a_text} 4
if env import -c ${a_text} ${text_size} BOOT_ORDER; then setenv a_good 1; fi
${devtype} read ${b} ${second} ${blocks}
setexpr.b b_counter *${b_count}
cp.b ${b} ${work} 4
cp.b ${work} ${b_text} 4
if env import -c ${b_text} ${text_size} BOOT_ORDER; then setenv b_good 1; fi

# Select the newer copy: the counter increases, and wraps from ff to 0. Source: libubootenv, uboot_env.c, libuboot_load.
setenv use none
if test ${a_good} = 1; then
  if test ${b_good} = 1; then
    setenv use a
    if test 0x${b_counter} -gt 0x${a_counter}; then setenv use b; fi
    if test 0x${a_counter} -eq 0xff && test 0x${b_counter} -eq 0; then setenv use b; fi
    if test 0x${b_counter} -eq 0xff && test 0x${a_counter} -eq 0; then setenv use a; fi
  else
    setenv use a
  fi
else
  if test ${b_good} = 1; then setenv use b; fi
fi
setenv BOOT_ORDER
setenv BOOT_A_LEFT
setenv BOOT_B_LEFT
setenv BOOT_NEW
setenv BOOT_AGAIN
setenv counter 0
setenv target ${first}
if test ${use} = a; then
  env import -c ${a_text} ${text_size} BOOT_ORDER BOOT_A_LEFT BOOT_B_LEFT BOOT_NEW BOOT_AGAIN
  setenv counter ${a_counter}
  setenv target ${second}
fi
if test ${use} = b; then
  env import -c ${b_text} ${text_size} BOOT_ORDER BOOT_A_LEFT BOOT_B_LEFT BOOT_NEW BOOT_AGAIN
  setenv counter ${b_counter}
  setenv target ${first}
fi
test -n "${BOOT_ORDER}" || setenv BOOT_ORDER "A B"
test -n "${BOOT_A_LEFT}" || setenv BOOT_A_LEFT 3
test -n "${BOOT_B_LEFT}" || setenv BOOT_B_LEFT 3
test -n "${BOOT_NEW}" || setenv BOOT_NEW 0
test -n "${BOOT_AGAIN}" || setenv BOOT_AGAIN 0
echo "slots: state of copy ${use}, order ${BOOT_ORDER}, tries left: A ${BOOT_A_LEFT}, B ${BOOT_B_LEFT}"

setenv save 'setexpr counter 0x${counter} + 1; setexpr counter 0x${counter} "&" 0xff; env export -c -s ${text_size} ${work_text} BOOT_ORDER BOOT_A_LEFT BOOT_B_LEFT BOOT_NEW BOOT_AGAIN; cp.b ${work_text} ${a} 4; cp.b ${a} ${work} 4; mw.b ${work_count} 0x${counter} 1; ${devtype} write ${work} ${target} ${blocks}'
setenv read_slot 'load ${devtype} ${devnum}:${number} ${kernel_addr_r} /boot/Image && load ${devtype} ${devnum}:${number} ${ramdisk_addr_r} /boot/initrd'

for slot in ${BOOT_ORDER}; do
  setenv left 0
  if test "${slot}" = "A"; then setenv left ${BOOT_A_LEFT}; setenv number 2; fi
  if test "${slot}" = "B"; then setenv left ${BOOT_B_LEFT}; setenv number 3; fi
  if test 0x${left} -gt 0; then
    setexpr left 0x${left} - 1
    if test "${slot}" = "A"; then setenv BOOT_A_LEFT ${left}; else setenv BOOT_B_LEFT ${left}; fi
    run save
    if test "${target}" = "${first}"; then setenv target ${second}; else setenv target ${first}; fi
    echo "slots: trying ${slot}, ${left} tries left after it"
    if run read_slot; then
      setenv bootargs "${console} root=PARTUUID=@LABEL@-0${number} ro rauc.slot=${slot} @COMMAND_LINE@ ${extra_args}"
      booti ${kernel_addr_r} ${ramdisk_addr_r}:${filesize} ${fdt_addr}
    fi
    echo "slots: ${slot} did not load"
  fi
done
# A slot that failed its trial, or is incomplete, gets no tries; otherwise it would start first again.
echo "slots: none is left: all tries again"
if test "${BOOT_NEW}" != "A"; then setenv BOOT_A_LEFT 3; fi
if test "${BOOT_NEW}" != "B"; then setenv BOOT_B_LEFT 3; fi
run save
reset
