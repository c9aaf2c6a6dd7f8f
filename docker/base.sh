#!/usr/bin/env bash
# A stand-in for debian:bookworm-slim where images cannot be pulled: made with debootstrap from the
# machine's own package mirror, with its certificates and package index. For the test of the build.
set -eu
folder=$1
mirror=$(awk '/^URIs:/ { print $2; exit } /^deb / { print $2; exit }' /etc/apt/sources.list.d/*.sources \
  /etc/apt/sources.list 2>/dev/null)
debootstrap --variant=minbase --include=ca-certificates bookworm "$folder" "$mirror" >/dev/null
# Beside the image's own certificates, which an update makes anew.
certificates=/etc/ssl/machine.crt
cp -L "${SSL_CERT_FILE:-/etc/ssl/certs/ca-certificates.crt}" "$folder$certificates"
cp -L /etc/resolv.conf "$folder/etc/" 2>/dev/null || true
for file in /etc/apt/sources.list.d/*.sources; do
  [ ! -f "$file" ] || cp "$file" "$folder/etc/apt/sources.list.d/"
done
container=$(buildah from scratch)
buildah copy -q "$container" "$folder" /
buildah config --env SSL_CERT_FILE="$certificates" --env PIP_CERT="$certificates" "$container"
buildah commit -q "$container" debian:bookworm-slim
buildah rm "$container" >/dev/null
