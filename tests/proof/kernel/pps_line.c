// SPDX-License-Identifier: GPL-2.0 OR Apache-2.0
/* The device at a GPIO line that a device tree would have for pps-gpio: a PC has none, and pps-gpio asks for one. */

#include <linux/err.h>
#include <linux/gpio/machine.h>
#include <linux/module.h>
#include <linux/platform_device.h>
#include <linux/property.h>

static char *label = "";
module_param(label, charp, 0444);
MODULE_PARM_DESC(label, "of the chip");

static ushort offset;
module_param(offset, ushort, 0444);
MODULE_PARM_DESC(offset, "of the line in its chip");

/* The first is an echo, at the next line and never switched on: without it, the second would be taken for that as well. */
static struct gpiod_lookup_table lines = {.dev_id = "pps-gpio", .table = {{}, {}, {}}};
static const struct property_entry properties[] = {PROPERTY_ENTRY_U32("echo-active-ms", 100), {}};
static const struct platform_device_info info = {
    .name = "pps-gpio",
    .id = PLATFORM_DEVID_NONE,
    .properties = properties,
};
static struct platform_device *device;

static int __init pps_line_init(void)
{
    lines.table[0] = GPIO_LOOKUP(label, offset + 1, "echo", GPIO_ACTIVE_HIGH);
    lines.table[1] = GPIO_LOOKUP(label, offset, NULL, GPIO_ACTIVE_HIGH);
    gpiod_add_lookup_table(&lines);
    device = platform_device_register_full(&info);
    if (IS_ERR(device))
        gpiod_remove_lookup_table(&lines);
    return PTR_ERR_OR_ZERO(device);
}

static void __exit pps_line_exit(void)
{
    platform_device_unregister(device);
    gpiod_remove_lookup_table(&lines);
}

module_init(pps_line_init);
module_exit(pps_line_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("a device for pps-gpio at a GPIO line");
