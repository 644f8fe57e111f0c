/* See hand_wire.h. */
#include "hand_wire.h"

#define CRC_SIZE (4U)
#define HEAD_SIZE (2U) /* version and type */
#define LONGEST_BLOCK (0xFFU)

uint32_t hand_wire_crc(const uint8_t *data, size_t size)
{
    static const uint32_t by_nibble[16] = { /* CRC of each half byte, polynomial EDB88320 */
        0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U, 0x4DB26158U, 0x5005713CU,
        0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU, 0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU};
    uint32_t crc = 0xFFFFFFFFU;
    for (size_t i = 0U; i < size; i++) {
        crc ^= data[i];
        crc = (crc >> 4U) ^ by_nibble[crc & 15U];
        crc = (crc >> 4U) ^ by_nibble[crc & 15U];
    }
    return crc ^ 0xFFFFFFFFU;
}

uint32_t hand_wire_read(const uint8_t *from, size_t bytes)
{
    uint32_t value = 0U;
    for (size_t i = bytes; i > 0U; i--) {
        value = (value << 8U) | from[i - 1U];
    }
    return value;
}

size_t hand_wire_write(uint8_t *to, size_t at, uint64_t value, size_t bytes)
{
    uint64_t rest = value;
    for (size_t i = 0U; i < bytes; i++) {
        to[at + i] = (uint8_t)(rest & 0xFFU);
        rest >>= 8U;
    }
    return at + bytes;
}

void hand_wire_start(hand_wire_receiver *r)
{
    r->filled = 0U;
    r->size = 0U;
    r->corrupt = 0U;
    r->overlong = false;
}

/* Decode COBS in place. Returns false where a code points beyond the end. */
static bool decode(uint8_t *data, size_t size, size_t *decoded)
{
    size_t from = 0U;
    size_t to = 0U;
    bool good = true;
    while (good && (from < size)) {
        const size_t code = data[from];
        const size_t next = from + code;
        from++;
        good = next <= size;
        while (good && (from < next)) {
            data[to] = data[from];
            to++;
            from++;
        }
        if (good && (code < LONGEST_BLOCK) && (from < size)) {
            data[to] = 0U;
            to++;
        }
    }
    *decoded = to;
    return good;
}

static bool complete(hand_wire_receiver *r)
{
    size_t size = 0U;
    bool good = decode(r->payload, r->filled, &size) && (size >= (CRC_SIZE + HEAD_SIZE));
    if (good) {
        r->size = size - CRC_SIZE;
        good = hand_wire_crc(r->payload, r->size) == hand_wire_read(&r->payload[r->size], CRC_SIZE);
    }
    if (!good) {
        r->corrupt++;
    }
    return good;
}

bool hand_wire_take(hand_wire_receiver *r, uint8_t byte)
{
    bool got = false;
    if (byte != 0U) {
        if (r->filled < HAND_WIRE_PACKET_SIZE) {
            r->payload[r->filled] = byte;
            r->filled++;
        } else if (!r->overlong) {
            r->overlong = true;
            r->corrupt++;
        } else {
            /* the rest of a packet that was given up */
        }
    } else {
        if ((!r->overlong) && (r->filled > 0U)) {
            got = complete(r);
        }
        r->filled = 0U;
        r->overlong = false;
    }
    return got;
}

static void close_block(uint8_t *packet, size_t *block, size_t *end)
{
    packet[*block] = (uint8_t)(*end - *block);
    *block = *end;
    (*end)++;
}

static void put(uint8_t *packet, size_t *block, size_t *end, uint8_t byte)
{
    if ((*end - *block) == LONGEST_BLOCK) {
        close_block(packet, block, end);
    }
    if (byte != 0U) {
        packet[*end] = byte;
        (*end)++;
    } else {
        close_block(packet, block, end);
    }
}

size_t hand_wire_packet(const uint8_t *payload, size_t size, uint8_t *packet)
{
    uint8_t crc[CRC_SIZE];
    size_t block = 0U;
    size_t end = 1U;
    (void)hand_wire_write(crc, 0U, hand_wire_crc(payload, size), CRC_SIZE);
    for (size_t i = 0U; i < size; i++) {
        put(packet, &block, &end, payload[i]);
    }
    for (size_t i = 0U; i < CRC_SIZE; i++) {
        put(packet, &block, &end, crc[i]);
    }
    packet[block] = (uint8_t)(end - block);
    packet[end] = 0U;
    return end + 1U;
}
