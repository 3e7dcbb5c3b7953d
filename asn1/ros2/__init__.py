"""ROS 2 message packages from the schema: which messages, with which fields, and how a field comes from the ASN.1."""
