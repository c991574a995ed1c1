typedef int orb_api_placeholder;
