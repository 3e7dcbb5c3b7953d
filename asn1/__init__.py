"""From the standards' ASN.1 modules to codecs: importer, schema, layout and back ends. Used when things are built."""
