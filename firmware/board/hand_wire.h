/* Packets of the serial wire format (docs/protocol.md): COBS, CRC-32 and the delimiter. C99, no heap, no library. */
#ifndef HAND_WIRE_H
#define HAND_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HAND_WIRE_PACKET_SIZE (1280U) /* longest packet that is received, delimiter left out */
#define HAND_WIRE_OVERHEAD (11U)      /* most bytes that a packet of at most 1280 bytes has beyond its payload */

/* Receives byte by byte; the caller reads payload, size and corrupt. */
typedef struct {
    uint8_t payload[HAND_WIRE_PACKET_SIZE];
    size_t filled;
    size_t size;      /* of the payload that was completed last */
    uint32_t corrupt; /* packets with a wrong code, CRC or length */
    bool overlong;
} hand_wire_receiver;

/* Begin between two packets. */
void hand_wire_start(hand_wire_receiver *r);

/* Take one byte. Returns true where it completes a valid packet: then payload and size hold its content until the next
 * call. */
bool hand_wire_take(hand_wire_receiver *r, uint8_t byte);

/* Write a payload as a packet with CRC and delimiter; returns its size, at most size + HAND_WIRE_OVERHEAD. The two
 * arrays must not overlap; size is at most HAND_WIRE_PACKET_SIZE - HAND_WIRE_OVERHEAD. */
size_t hand_wire_packet(const uint8_t *payload, size_t size, uint8_t *packet);

/* CRC-32/ISO-HDLC. */
uint32_t hand_wire_crc(const uint8_t *data, size_t size);

/* Little-endian numbers. */
uint32_t hand_wire_read(const uint8_t *from, size_t bytes);
size_t hand_wire_write(uint8_t *to, size_t at, uint64_t value, size_t bytes);

#endif
